"""Boards with a Cortex-M that QEMU has: build an exported folder for one, run it there, count
instructions.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import HarpyError
from harpy_pin.export.code import shipped
from harpy_pin.kernels.compiler import run_program, work_folder

COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
ICOUNT = "shift=6,align=off,sleep=off"
"""Every instruction takes 64 ns: more than a tick of the board's clock, so that each is seen."""
COMMON = ("-std=c99", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections")
MOST = 600.0  # time for one program, s


@dataclass(frozen=True)
class Chip:
    """A processor, and QEMU's board with it."""

    title: str  # its name
    cpu: str  # for the compiler
    fpu: str  # its floating-point unit, for the compiler
    double: bool  # whether it computes in double precision itself
    machine: str  # QEMU's board
    flash: int  # where code begins
    ram: int  # where data begins

    @property
    def flags(self) -> list[str]:
        """Flags of the compiler."""
        return [f"-mcpu={self.cpu}", "-mthumb", "-mfloat-abi=hard", f"-mfpu={self.fpu}"]


CHIPS = {
    "m4": Chip("Cortex-M4F", "cortex-m4", "fpv4-sp-d16", False, "mps2-an386", 0x0, 0x20000000),
    "m7": Chip("Cortex-M7", "cortex-m7", "fpv5-d16", True, "mps2-an500", 0x0, 0x20000000),
    "m33": Chip(
        "Cortex-M33", "cortex-m33", "fpv5-sp-d16", False, "mps2-an505", 0x10000000, 0x38000000
    ),
}
"""Chips by their short names."""


@dataclass(frozen=True)
class Measured:
    """What a controller costs on a chip."""

    instructions: NDArray[np.int64]  # of each recorded tick
    stack: int  # deepest stack, bytes
    flash: int  # code and constants with what they need of C's libraries, bytes
    different: int  # ticks whose command is not the recorded one


def missing_tools() -> str | None:
    """What has to be installed to build for a board and run it; None where all is there."""
    packages = {COMPILER: "gcc-arm-none-eabi libnewlib-arm-none-eabi", EMULATOR: "qemu-system-arm"}
    names = [package for tool, package in packages.items() if shutil.which(tool) is None]
    return None if not names else f"apt-get install {' '.join(names)}"


def board_text(chip: Chip) -> str:
    """The linker script of a chip's board."""
    return shipped("board/mps2.ld", board=chip.machine, flash=hex(chip.flash), ram=hex(chip.ram))


def build(
    folder: Path,
    sources: Sequence[Path | str],
    chip: Chip,
    program: Path,
    *,
    flags: Sequence[str] = ("-O2",),
) -> Path:
    """Link a program for a chip's board, of sources besides the board's own; relative ones are in
    the exported folder.

    The flags are those of the compiler besides those that the chip needs. A :class:`HarpyError` has
    what the compiler says where it does not compile.
    """
    command = [COMPILER, *chip.flags, *COMMON, *flags]
    command += [str(folder / source) for source in (*sources, "board/startup.c")]
    command += ["-I", str(folder), "-T", str(folder / f"board/{chip.machine}.ld")]
    command += [
        "-nostartfiles",
        "--specs=rdimon.specs",
        "-Wl,--gc-sections",
        "-o",
        str(program),
        "-lm",
    ]
    _call(command)
    return program


def run(program: Path, chip: Chip) -> tuple[str, int]:
    """Run a program on a chip's board in QEMU; returns what it printed, and its exit code."""
    machine = [
        EMULATOR,
        "-machine",
        chip.machine,
        "-nographic",
        "-monitor",
        "none",
        "-serial",
        "none",
    ]
    target = [
        "-semihosting-config",
        "enable=on,target=native",
        "-icount",
        ICOUNT,
        "-kernel",
        str(program),
    ]
    return run_program([*machine, *target], timeout=MOST)


def measure(folder: Path, name: str, chip: Chip, *, flags: Sequence[str] = ("-O2",)) -> Measured:
    """Count a controller, whose files have this name, with its recorded ticks in an exported
    folder, on a chip.

    The flags are the compiler's. A :class:`HarpyError` says that it does not compile, or that the
    program failed.
    """
    folder = folder.resolve()  # sources are named from it
    with work_folder() as work:
        place = Path(work)
        controller = _object(folder, f"{name}.c", chip, place / "controller.o", flags)
        vectors = folder / "board" / f"vectors-{chip.cpu}.o"  # large, and the same for all flags
        if not vectors.exists():
            made = vectors.with_suffix(
                f".{place.name}"
            )  # others may count on the same chip meanwhile
            _object(folder, "vectors.c", chip, made, ["-O1"]).replace(vectors)
        program = build(
            folder, [controller, vectors, "count.c"], chip, place / "count.elf", flags=flags
        )
        text, code = run(program, chip)
        if code:
            raise HarpyError(f"{name} failed on {chip.title} with exit code {code}: {text[-200:]}")
        flash = _flash(folder, name, chip, controller, place, flags)
    lines = text.split("\n")
    painted, different = map(int, lines[0].split()[1::2])
    instructions, ticks = map(int, lines[1].split()[1:])
    counts = np.array([int(line) for line in lines[2:] if line])
    return Measured(
        np.rint(counts * (instructions / ticks)).astype(np.int64), painted, flash, different
    )


def _flash(
    folder: Path, name: str, chip: Chip, controller: Path, place: Path, flags: Sequence[str]
) -> int:
    """How much larger a program is with the controller than without it."""
    header = (folder / f"{name}.h").read_text(encoding="utf-8")
    declaration = header[header.rindex(f"int {name}_step(") :].split(";")[0]
    real = "double" if "const double" in declaration else "float"
    arguments = ", ".join(["numbers"] * (declaration.count(",") - 1))
    source = place / "uses.c"
    text = shipped("board/uses.c", name=name, real=real, arguments=arguments)
    source.write_text(text, encoding="utf-8")
    sizes = []
    for extra in ((), ("-DUSED",)):
        program = build(
            folder, [source, controller], chip, place / "uses.elf", flags=(*flags, *extra)
        )
        text, data = _call([SIZE, str(program)]).split("\n")[1].split()[:2]
        sizes.append(int(text) + int(data))
    return sizes[1] - sizes[0]


def _object(folder: Path, source: str, chip: Chip, made: Path, flags: Sequence[str]) -> Path:
    _call(
        [
            COMPILER,
            *chip.flags,
            *COMMON,
            *flags,
            "-I",
            str(folder),
            "-c",
            str(folder / source),
            "-o",
            str(made),
        ]
    )
    return made


def _call(command: Sequence[str]) -> str:
    said, code = run_program(list(command))
    if code:
        raise HarpyError(f"{command[0]} failed: {said[-2000:]}")
    return said
