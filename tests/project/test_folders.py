"""Folders that are written to: no file of a user's is changed, and what was exported before is
replaced whole.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from command_line import harpy
from processes import living, needs_proc

from comparison.cli.program import main as comparison
from harpy_pin import InputError, RunFileError
from harpy_pin.files import OwnFolder

FILES = {"README.md": "ours", "CMakeLists.txt": "ours", "board/startup.c": "ours", "x.c": "ours"}


def content(folder: Path) -> dict[str, object]:
    """What is in a folder, links and pipes as they are."""
    paths = sorted(folder.rglob("*"))
    return {
        str(p.relative_to(folder)): os.readlink(p)
        if p.is_symlink()
        else p.is_file() and p.read_text()
        for p in paths
    }


def hostile_folder(rng: np.random.Generator, folder: Path, outside: Path) -> None:
    """A folder with files of a user's, links out of it, pipes and folders of our names, and earlier
    files of ours.
    """
    rate = rng.uniform(0.0, 0.5)
    if rng.random() < 0.5:
        OwnFolder(folder).write(
            {name: f"earlier {rng.integers(2)}" for name in FILES if rng.random() < 0.7}
        )
    for name in (*FILES, "main.c", "board/a.o", OwnFolder.LIST):
        path, kind = (
            folder / name,
            rng.choice(["file", "file", "link", "nowhere", "pipe", "folder", "folder link"]),
        )
        if rng.random() > rate or not path.parent.resolve().is_relative_to(folder):
            continue
        path.parent.mkdir(exist_ok=True, parents=True)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        if kind == "file":
            path.write_text(f"mine {rng.random()}")
        elif kind == "pipe":
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir()
            (path / "mine").write_text("mine")
        else:
            path.symlink_to(
                {"link": outside / "target", "nowhere": outside / "none"}.get(str(kind), outside)
            )


def test_no_file_of_a_users_is_changed(tmp_path, fuzz, monkeypatch):
    """Of 250 hostile folders; with ``force`` regular files of our names in the folder itself are
    replaced, no more.
    """
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # which takes most of the time
    rng, written = np.random.default_rng(0), 0
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "target").write_text("precious")
    for n in range(250 * fuzz):
        folder, force = tmp_path / f"{n}", bool(rng.random() < 0.3)
        hostile_folder(rng, folder, outside)
        before, listed = content(folder), ""
        if not (folder / OwnFolder.LIST).is_symlink() and (folder / OwnFolder.LIST).is_file():
            listed = (folder / OwnFolder.LIST).read_text()
        try:
            OwnFolder(folder, force=force).write(FILES)
        except RunFileError:
            changed = {name for name, text in content(folder).items() if before.get(name) != text}
            assert not changed or (force and changed == {OwnFolder.LIST})
        else:
            after, written = content(folder), written + 1
            assert {name: after[name] for name in FILES} == FILES
            for name, text in before.items():
                if name not in FILES and name != OwnFolder.LIST:
                    assert after[name] == text
                elif name in FILES and not force:
                    assert str(text).startswith("earlier")
                    assert name in listed
        assert content(outside) == {"target": "precious"}
        assert not list(folder.rglob("*.part"))
    assert 50 * fuzz < written < 225 * fuzz


@pytest.mark.parametrize(
    ("name", "says"),
    [
        *(
            ("file", "it is no folder"),
            ("file/child", "Not a directory"),
            ("/proc/x", "cannot write into '/proc/x'"),
        ),
        *(
            ("nowhere", "it is no folder"),
            ("n" * 300, "too long"),
            ("taken", "it is a link, or|not written here"),
        ),
        *(
            ("two\nlines", "printable"),
            ("", "printable"),
            ("-", "printable"),
            ("\ud800", "printable"),
            ("a\0b", "printable"),
        ),
    ],
)
def test_names_that_cannot_be_used(name, says, tmp_path, monkeypatch, capsys):
    """One line each, from all three programs, and nothing is made."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "nowhere").symlink_to("none")
    (tmp_path / "taken" / "README.md").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    before = content(tmp_path)
    with pytest.raises((InputError, RunFileError), match=says) as error:
        OwnFolder(name)
    assert "\n" not in str(error.value)
    if "\0" not in name:
        code, _, said = harpy(monkeypatch, capsys, "export", "iris", "--to", name)
        assert (code, said[:7], said.count("\n")) == (2, "harpy: ", 1)
        monkeypatch.setattr(sys, "argv", ["comparison", "--quick", "--out", name])
        with pytest.raises(SystemExit):
            comparison()
        assert capsys.readouterr().err.count("\n") == 1
    assert content(tmp_path) == before


def test_an_export_into_a_project_is_refused(tmp_path, monkeypatch, capsys):
    """The first attack: README.md, CMakeLists.txt, objects, and a link out of the folder."""
    (tmp_path / "target").write_text("precious")
    project = tmp_path / "my project"
    (project / "board").mkdir(parents=True)
    for name in ("README.md", "CMakeLists.txt", "board/a.o"):
        (project / name).write_text("mine")
    (project / "check.c").symlink_to("../target")
    monkeypatch.setattr("harpy_pin.export.folder.missing_tools", lambda: "none desired")
    before = content(tmp_path)
    words = ["export", "iris", "--to", str(project), "--precision", "double"]
    for more, says in (([], "--force"), (["--force"], "check.c' is a link")):
        code, _, said = harpy(monkeypatch, capsys, *words, *more)
        assert code == 2
        assert says in said
    after = content(tmp_path)
    del after[f"my project/{OwnFolder.LIST}"]
    assert after == before


@pytest.mark.needs("cmake")
def test_printed_commands_work_in_a_folder_with_a_space(tmp_path, monkeypatch, capfd):
    """Exported twice into the same folder, beside a user's own file; then what is printed is run as
    it is.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("harpy_pin.export.folder.missing_tools", lambda: "none desired")
    for controller in ("wbc", "condensed"):
        words = [
            "export",
            "iris",
            "--to",
            "-my 'folder'",
            "--precision",
            "double",
            "--controller",
            controller,
        ]
        code, printed, said = harpy(monkeypatch, capfd, *words)
        assert code == 0, said
        (tmp_path / "-my 'folder'" / "main.c").write_text("mine")
    said = subprocess.run(
        printed.splitlines()[-1], shell=True, capture_output=True, text=True
    ).stdout
    assert "all equal: 200 ticks of iris_condensed, double" in said
    assert (tmp_path / "-my 'folder'" / "main.c").read_text() == "mine"
    names = subprocess.run(
        ["sha256sum", "-c", OwnFolder.LIST], cwd="-my 'folder'", capture_output=True, text=True
    )
    assert names.returncode == 0, names.stderr
    assert "iris_wbc.c: OK" in names.stdout


@needs_proc
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGKILL"])
def test_compilers_end_with_the_command(name, tmp_path):
    """With the processes that they have started, whichever signal ends it."""
    number, killed = getattr(signal, name), name == "SIGKILL"
    mark, handler = (
        f"4{os.getpid()}.{number:02d}",
        "default_int_handler" if number == signal.SIGINT else "SIG_DFL",
    )
    script = (
        f"import signal, sys, typer\nif not {killed}: signal.signal({number:d}, signal.{handler})  "
        f"# ignored before\n"
        "from harpy_pin.cli.signals import leave_at_signals\n"
        "from harpy_pin.cli.ending import stopping\nfrom harpy_pin.export import "
        "board\nleave_at_signals()\n"
        f"command = ['sh', '-c', 'sleep {mark} & echo > started; sleep {mark}']\n"
        "try:\n    stopping(lambda: board._call(command))()\nexcept typer.Exit as end:\n    "
        "sys.exit(end.exit_code)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], cwd=tmp_path, stderr=subprocess.DEVNULL
    )
    while process.poll() is None and not (tmp_path / "started").exists():
        time.sleep(0.02)
    process.send_signal(number)
    assert process.wait(60) == (-number if killed else 128 + number)
    deadline = time.monotonic() + 10.0
    while left := list(living(f"sleep {mark}")):
        assert time.monotonic() < deadline, left
        time.sleep(0.05)
