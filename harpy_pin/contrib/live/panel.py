"""The panels of the live page: what is set, what is done, and what it leads to in numbers and
charts.

A panel says what the driver wants, and shows how things stand. The session checks what a page has
sent; where it refuses something, or changes it by itself, the controls follow.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import viser

from harpy_pin.contrib.live.charts import Charts, WholeFeet
from harpy_pin.contrib.live.settings import MAX_FRICTION, MAX_SLOPE, MIN_FRICTION, DriveRanges
from harpy_pin.model.robot import Robot
from harpy_pin.simulation.sensors import ESTIMATED, TRUE
from harpy_pin.view.identity import CONTROLLERS

PACES = {"real time": 1.0, "1/2": 0.5, "1/5": 0.2, "1/20": 0.05}
STEPS = {"1 ms": 1, "10 ms": 10, "100 ms": 100}
DIRECTIONS = {"forward": (1.0, 0.0), "back": (-1.0, 0.0), "left": (0.0, 1.0), "right": (0.0, -1.0)}
KEYS = (
    (("W", "arrowup"), "Faster forward", "forward", 0.1),
    (("S", "arrowdown"), "Slower, or back", "forward", -0.1),
    (("A", "arrowleft"), "Turn left", "turning", 0.2),
    (("D", "arrowright"), "Turn right", "turning", -0.2),
    (("Q",), "Sideways to the left", "sideways", 0.05),
    (("E",), "Sideways to the right", "sideways", -0.05),
)
"""Keys, label, setting and how much it changes."""
HELP = (
    "**W S** or **↑ ↓** speed · **A D** or **← →** turn · **Q E** sideways · **X** stop · "
    "**P** pause · **N** step · **R** reset · **I** friction strip · **J L** push. "
    "Drag the robot to pull it."
)
SLOW = 0.97
"""Real-time factor below which the page says that it cannot keep up."""
SMOOTH = 0.2
"""Share of the present power in the one that is shown."""
Send = Callable[[str, Any], None]


class Panel:
    """Controls and numbers.

    Args:
        gui: of viser.
        robot: who is driven.
        ranges: what may be set with it.
        settings: as the session begins.
        send: takes a wish to the session: its kind and its value.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        robot: Robot,
        ranges: DriveRanges,
        settings: Mapping[str, Any],
        send: Send,
    ) -> None:
        self._gui, self._send, self._ranges, self._feet = gui, send, ranges, WholeFeet(robot)
        self._settings = dict(settings)
        self._handles: dict[str, Any] = {}
        self._shown: dict[str, Callable[[Any], Any]] = {}  # a setting as its control shows it
        self._dragged: set[str] = set()
        self._lock = threading.Lock()
        self._power = np.zeros(2)
        self._standing: dict[str, Any] = {
            "paused": False,
            "ending": "",
            "note": "",
            "refused": False,
            "busy": "",
        }
        gui.set_panel_label("harpy live")
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="medium")
        self._status = gui.add_markdown("starting…")
        tabs, kinds = gui.add_tab_group(), ("Drive", "Ground", "Control", "Push")
        for kind, add in zip(
            kinds,
            (self._add_drive, self._add_ground, self._add_control, self._add_push),
            strict=True,
        ):
            with tabs.add_tab(kind):
                add(gui)
        with tabs.add_tab("Keys"):
            gui.add_markdown(HELP)
        self._numbers = gui.add_markdown("")
        charts = gui.add_panel()
        with charts.add_tab("Last 5 s"):
            self.charts = Charts(gui, self._feet)
        charts.float(x=14.0, y=-14.0, width=380.0)
        self._add_keys(gui)

    def take(self, standing: Mapping[str, Any]) -> None:
        """How things stand, from the session."""
        with self._lock:
            self._standing = dict(standing)
            self._settings = standing["settings"]
        self._pause.label = "Go on" if standing["paused"] else "Pause"
        for name, handle in self._handles.items():
            value = self._shown[name](self._settings[name])
            if handle.value != value and (standing["refused"] or name not in self._dragged):
                handle.value = value
        self._dragged.clear()
        self._assumed.disabled = self._settings["assumed"] is None

    def refuse(self, reason: str) -> None:
        """Say why something that a page sent was not done."""
        with self._lock:
            self._standing |= {"note": reason, "refused": True}

    @property
    def note(self) -> str:
        """What is said last of a wish; empty where all was done."""
        return str(self._standing["note"])

    @property
    def follows(self) -> bool:
        """Whether the camera follows the robot."""
        return bool(self._follows.value)

    def show(self, s: Any) -> None:
        """Numbers of a snapshot."""
        with self._lock:
            settings, standing = self._settings, self._standing
        _say(self._status, _state(settings, standing, float(s["factor"])))
        force = self._feet.force(s["contact_force"])
        normal = np.maximum(force[:, 2], 1e-9)
        room = np.maximum(self._feet.least(s["foot_friction"]), 1e-9)
        used = np.where(force[:, 2] > 1.0, np.hypot(force[:, 0], force[:, 1]) / normal / room, 0.0)
        self._power += SMOOTH * (s["power"] - self._power)
        joints, thrusters = self._power
        v, drift = s["applied_velocity"], float(np.linalg.norm(s["estimated_q"][:3] - s["q"][:3]))
        rows = (
            ("Time", f"{float(s['t']):.1f} s"),
            ("Falls", f"{int(s['falls'])}"),
            ("Applied", f"{v[0]:.2f}, {v[1]:.2f} m/s, {v[2]:.2f} rad/s"),
            ("Slip", f"{1e3 * float(np.sum(s['slip_path'])):.1f} mm"),
            (
                "Power",
                f"{joints:.0f} W joints"
                + (f", {thrusters:.0f} W thrusters" if len(s["thrust"]) else ""),
            ),
            ("Friction used", " · ".join(f"{100.0 * share:.0f} %" for share in used)),
            (
                "Assumed μ",
                " · ".join(f"{value:.2f}" for value in self._feet.least(s["friction_estimate"])),
            ),
            *((("Estimate", f"{1e3 * drift:.0f} mm off"),) if np.isfinite(drift) else ()),
            ("Tick", f"p50 {float(s['p50']):.0f}, p99 {float(s['p99']):.0f} µs"),
            (
                "Real time",
                f"{s['factor']:.2f} ×"
                + (f", {float(s['lost']):.1f} s lost" if s["lost"] > 0.05 else ""),
            ),
        )
        _say(
            self._numbers,
            "| | |\n|:--|:--|\n" + "\n".join(f"| {name} | {value} |" for name, value in rows),
        )

    def _add_drive(self, gui: viser.GuiApi) -> None:
        ranges = self._ranges
        if ranges.schedules:
            schedule = gui.add_button_group(
                "Schedule", ranges.schedules, hint="Keys 1, 2, … It stops to change."
            )
            schedule.on_click(lambda event: self._send("change", {"schedule": event.target.value}))
        turn_hint = None if ranges.schedules else "The joint PIDs face x: they do not turn."
        scales_down = "The gait scales down what its legs cannot do."
        self._slider("forward", "Forward, m/s", -ranges.forward, ranges.forward, 0.05, scales_down)
        self._slider("sideways", "Left, m/s", -ranges.sideways, ranges.sideways, 0.05)
        self._slider("turning", "Turn left, rad/s", -ranges.turning, ranges.turning, 0.1, turn_hint)
        if ranges.height is not None:
            self._slider(
                "height", "Height, m", *ranges.height, 0.01, "Change of the body's height."
            )
        self._pause = gui.add_button("Pause", hint="Key P")
        self._pause.on_click(lambda _: self._toggle())
        walk = gui.add_button_group("Walk", ("Stop", "Reset"), hint="Keys X and R")
        walk.on_click(
            lambda event: (
                self._stop() if event.target.value == "Stop" else self._send("reset", None)
            )
        )
        step = gui.add_button_group("Step", tuple(STEPS))
        step.on_click(lambda event: self._send("step", STEPS.get(event.target.value)))
        self._choice("pace", "Pace", PACES)
        self._follows = gui.add_checkbox(
            "Camera follows", True, hint="Without, the keys that drive move it, too."
        )

    def _add_ground(self, gui: viser.GuiApi) -> None:
        self._slider(
            "friction",
            "Friction",
            MIN_FRICTION,
            MAX_FRICTION,
            0.01,
            "Static; sliding friction is 0.9 of it.",
        )
        softest, hardest = (round(1e-3 * end, 1) for end in self._ranges.stiffness)
        gently = "It changes by a factor of e in 0.25 s: at once, it would throw the robot."
        step = 0.1 if softest < 2.0 else 1.0
        self._slider("stiffness", "Stiffness, kN/m", softest, hardest, step, gently, unit=1e3)
        steepest = math.floor(math.degrees(MAX_SLOPE))
        self._slider(
            "slope",
            "Slope, °",
            -steepest,
            steepest,
            1,
            "It tilts by 6° in a second.",
            unit=math.radians(1.0),
        )
        self._strip = gui.add_slider("Friction of strip", 0.02, 0.5, 0.01, 0.1)
        ahead = gui.add_button("Friction strip ahead", hint="I: 0.6 m along x, across the way")
        ahead.on_click(lambda _: self._lay_strip())
        gui.add_button("No friction strip").on_click(
            lambda _: self._send("change", {"friction_strips": ()})
        )

    def _add_control(self, gui: viser.GuiApi) -> None:
        self._choice(
            "controller",
            "Controller",
            {CONTROLLERS[name].label: name for name in self._ranges.controllers},
        )
        known, friction = self._settings["assumed"] is None, self._settings["friction"]
        self._knows = gui.add_checkbox(
            "Knows the friction", True, hint="Of the ground, not of the strip."
        )
        self._assumed = gui.add_slider(
            "Assumes", MIN_FRICTION, MAX_FRICTION, 0.01, friction, disabled=known
        )
        self._knows.on_update(self._on_assumed)
        self._assumed.on_update(self._on_assumed)
        estimate = gui.add_checkbox(
            "Estimates friction", False, hint="From measured forces and slip."
        )
        self._bind("estimate", estimate, bool, bool)
        sensed = gui.add_checkbox(
            "Knows only its sensors", False, hint="Inertial unit, encoders, motor torques."
        )
        self._bind(
            "state",
            sensed,
            lambda state: bool(state == ESTIMATED),
            lambda on: ESTIMATED if on else TRUE,
        )
        self._slider("delay", "Delay, ms", 0, 10, 1, "Of the measurements.")
        self._slider("noise", "Noise", 0.0, 3.0, 0.1, "As a multiple of typical noise.")

    def _add_push(self, gui: viser.GuiApi) -> None:
        gui.add_markdown("Drag the robot to pull it, or push it:")
        share = self._ranges.impulse / 30.0
        self._impulse = gui.add_slider(
            "Impulse, N·s", share, round(20.0 * share, 1), 0.5 * share, 5.0 * share
        )
        group = gui.add_button_group("Push", tuple(DIRECTIONS))
        group.on_click(lambda event: self._push(event.target.value))

    def _add_keys(self, gui: viser.GuiApi) -> None:
        """Keys, which the command palette lists too."""
        actions: list[tuple[str, str, Callable[[], None]]] = [
            (key, label, partial(self._nudge, name, change))
            for keys, label, name, change in KEYS
            for key in keys
        ]
        actions += [
            ("X", "Stop", self._stop),
            ("P", "Pause or go on", self._toggle),
            ("N", "Step 10 ms", lambda: self._send("step", 10)),
            ("R", "Reset", lambda: self._send("reset", None)),
            ("I", "Friction strip ahead", self._lay_strip),
            ("J", "Push left", lambda: self._push("left")),
            ("L", "Push right", lambda: self._push("right")),
        ]
        for number, schedule in enumerate(self._ranges.schedules):
            wish = {"schedule": schedule}
            actions.append(
                (str(number + 1), schedule.capitalize(), partial(self._send, "change", wish))
            )
        for key, label, act in actions:
            button = gui.add_command(label, hotkey=key)  # type: ignore[arg-type]
            button.on_trigger(lambda _, act=act: act())  # type: ignore[misc]

    def _slider(
        self,
        name: str,
        label: str,
        low: float,
        high: float,
        step: float,
        hint: str | None = None,
        unit: float = 1,
    ) -> None:
        """A slider of a setting, which it shows in a unit; one whose step is whole shows whole
        numbers.
        """

        def shown(value: float) -> float:
            return round(value / unit) if isinstance(step, int) else value / unit

        handle = self._gui.add_slider(
            label, low, high, step, shown(self._settings[name]), hint=hint
        )
        self._bind(name, handle, shown, lambda value: unit * value)

    def _choice(self, name: str, label: str, values: Mapping[str, Any]) -> None:
        by_value = {value: text for text, value in values.items()}
        handle = self._gui.add_dropdown(
            label, tuple(values), initial_value=by_value.get(self._settings[name])
        )
        self._bind(name, handle, by_value.get, values.get)

    def _bind(
        self, name: str, handle: Any, shown: Callable[[Any], Any], read: Callable[[Any], Any]
    ) -> None:
        """What a driver changes in a control is sent; what we change is not."""
        self._handles[name], self._shown[name] = handle, shown

        def changed(event: Any) -> None:
            if event.client is not None:
                self._dragged.add(name)
                self._send("change", {name: read(event.target.value)})

        handle.on_update(changed)

    def _on_assumed(self, event: Any) -> None:
        if event.client is not None:
            self._send(
                "change", {"assumed": None if self._knows.value else float(self._assumed.value)}
            )

    def _nudge(self, name: str, change: float) -> None:
        handle = self._handles[name]
        value = round(min(max(handle.value + change, handle.min), handle.max), 3)
        handle.value = value
        self._send("change", {name: value})

    def _toggle(self) -> None:
        self._send("pause", not self._standing["paused"])

    def _stop(self) -> None:
        self._send("change", {"forward": 0.0, "sideways": 0.0, "turning": 0.0})

    def _lay_strip(self) -> None:
        self._send("strip", float(self._strip.value))

    def _push(self, direction: str) -> None:
        x, y = DIRECTIONS.get(direction, (math.nan, math.nan))
        size = float(self._impulse.value)
        self._send("push", (x * size, y * size, 0.0))


def _say(handle: Any, text: str) -> None:
    if handle.content != text:
        handle.content = text


def _state(settings: Mapping[str, Any], standing: Mapping[str, Any], factor: float) -> str:
    """How the walk goes, who walks it, and what became of the last wish, as markdown."""
    ending, slow = standing["ending"], 1.0 / settings["pace"]
    if standing["busy"]:
        state = f"**{_plain(standing['busy'])}**"
    elif ending:
        state = f"**{_plain(ending[:1].upper() + ending[1:])}.** Press Reset (R)"
    elif standing["paused"]:
        state = "**Paused**"
    elif factor < SLOW:
        state = f"**Cannot keep real time: {factor:.2f} ×**"
    else:
        state = "**Real time**" if slow == 1.0 else f"**{slow:.0f} × slower than real time**"
    schedule = f" · {settings['schedule']}" if settings["schedule"] else ""
    note = _plain(standing["note"])
    refused = "**Refused:** " if standing["refused"] else ""
    heading = f"{state} · {CONTROLLERS[settings['controller']].label}{schedule}"
    return f"{heading}\n\n{refused}{note}" if note else heading


def _plain(text: str) -> str:
    """Text that may hold names, as markdown that shows it as it is."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]<>()#+!|~" else c for c in text)
