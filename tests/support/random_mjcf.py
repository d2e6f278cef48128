"""Random MJCF files: trees under a free joint, with classes, frames, units and sections in any
order.
"""

import xml.etree.ElementTree as ET

import numpy as np

MESH = "0 0 0  0.2 0 0  0 0.3 0  0 0 0.1  0.1 0.1 0.2"


class RandomFile:
    """One file. ``refused`` is in the message where the robot is none, ``feet`` are frames of its
    limbs' ends.
    """

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.degrees, self.refused, self.feet, self.joints, self.bodies = self.yes(), "", [], [], 0
        sections = [*self.settings(), self.defaults(), *self.worlds(), *self.actuators()]
        root = ET.Element("mujoco", model=f"robot{seed}")
        root.extend(sections[k] for k in self.rng.permutation(len(sections)))
        self.text = ET.tostring(root, encoding="unicode")

    def yes(self, share=0.5):
        return self.rng.random() < share

    def numbers(self, count, scale=1.0):
        return " ".join(str(x) for x in self.rng.normal(0.0, scale, count))

    def angles(self, *values):
        return " ".join(str(np.degrees(x) if self.degrees else x) for x in values)

    def settings(self):
        compiler = ET.Element("compiler", angle="degree" if self.degrees else "radian")
        compiler.set("eulerseq", self.rng.choice(["xyz", "XYZ", "zyx"]))
        asset = ET.Element("asset")
        ET.SubElement(asset, "mesh", name="wedge", vertex=MESH, scale="0.5 0.7 1.1")
        return [compiler, asset, ET.Element("option", gravity=self.numbers(3, 5.0))]

    def defaults(self):
        top = ET.Element("default")
        ET.SubElement(top, "joint", armature="0.02", damping="0.3", frictionloss="0.1")
        ET.SubElement(top, "geom", density="300")
        limb = ET.SubElement(top, "default", {"class": "limb"})
        ET.SubElement(limb, "joint", armature="0.05", axis="0 1 0", range=self.angles(-1.2, 0.7))
        ET.SubElement(limb, "geom", pos="0.1 0.05 0", mass="0.7", contype="0", conaffinity="0")
        ET.SubElement(limb, "site", pos="0 0 -0.2", euler=self.angles(0.1, 0.2, 0.3))
        inner = ET.SubElement(limb, "default", {"class": "inner"})
        ET.SubElement(inner, "joint", damping="0.9", type="slide", limited="false")
        ET.SubElement(inner, "geom", type="box", size="0.1 0.2 0.05")
        return top

    def worlds(self):
        first, second = ET.Element("worldbody"), ET.Element("worldbody")
        ET.SubElement(first, "geom", type="plane", size="1 1 1")
        door = ET.SubElement(second, "body", name="door")
        ET.SubElement(door, "joint", name="hinge", axis="0 0 1")
        ET.SubElement(door, "geom", size="0.1")
        base = ET.SubElement(first, "body", name="base", pos=self.numbers(3), **self.turn())
        if self.yes():
            ET.SubElement(base, "freejoint", name="root")
        else:  # which has the class's armature
            ET.SubElement(base, "joint", name="root", type="free", damping="0", frictionloss="0")
        self.inertia(base)
        for _ in range(self.rng.integers(1, 4)):
            self.limb(base, int(self.rng.integers(1, 4)))
        ball = ET.SubElement(second, "body", name="ball", pos="3 0 0")
        ET.SubElement(ball, "freejoint")
        ET.SubElement(ball, "geom", size="0.1")
        return [first, second] if self.yes() else [second, first]

    def turn(self):
        kind = self.rng.choice(["quat", "euler", "axisangle", "xyaxes", "zaxis", "none"])
        if kind == "none":
            return {}
        if kind == "axisangle":
            return {"axisangle": f"{self.numbers(3)} {self.angles(self.rng.uniform(-3.0, 3.0))}"}
        if kind == "euler":
            return {"euler": self.angles(*self.rng.uniform(-2.0, 2.0, 3))}
        return {kind: self.numbers({"quat": 4, "xyaxes": 6, "zaxis": 3}[kind])}

    def inertia(self, body):
        if self.yes():
            inertial = ET.SubElement(
                body, "inertial", pos=self.numbers(3, 0.1), mass=str(self.rng.uniform(0.2, 5.0))
            )
            if self.yes():
                root = self.rng.normal(size=(3, 3))
                full = root @ root.T
                full = 0.05 * (np.trace(full) * np.eye(3) - full)
                inertial.set(
                    "fullinertia",
                    " ".join(
                        str(full[i, j])
                        for i, j in zip((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2), strict=True)
                    ),
                )
            else:
                inertial.set("diaginertia", "0.03 0.04 0.05")
                inertial.set("quat", self.numbers(4))
        for _ in range(self.rng.integers(1, 3)):
            geom = ET.SubElement(body, "geom", **self.shape())
            if self.yes(0.3) and "fromto" not in geom.attrib:
                geom.set("class", str(self.rng.choice(["limb", "inner"])))
            if self.yes(0.3):
                geom.set("mass", "1.3")

    def shape(self):
        kind = self.rng.choice(
            ["sphere", "box", "capsule", "cylinder", "ellipsoid", "mesh", "ends"]
        )
        if kind == "ends":
            return {
                "type": "capsule",
                "fromto": self.numbers(6, 0.2),
                "size": "0.03",
                "class": "main",
            }
        if kind == "mesh":
            return {"type": "mesh", "mesh": "wedge", "pos": self.numbers(3, 0.1)}
        return {"type": str(kind), "size": "0.1 0.2 0.15", **self.turn()}

    def limb(self, parent, length):
        if self.yes(0.3):
            parent = ET.SubElement(parent, "frame", pos=self.numbers(3, 0.1), **self.turn())
        self.bodies += 1
        number = self.bodies
        body = ET.SubElement(parent, "body", pos=self.numbers(3, 0.3), **self.turn())
        if self.yes(0.9):
            body.set("name", f"body{number}")
        if self.yes():
            body.set("childclass", str(self.rng.choice(["limb", "inner"])))
        self.inertia(body)
        if self.yes(0.03):
            ET.SubElement(body, "joint", type="ball", limited="false")
            self.refused = "is a ball joint"
        else:
            for k in range(self.rng.choice([0, 1, 1, 1, 2, 3])):
                self.joint(body, f"joint{number}_{k}")
        if self.yes(0.2):
            copies = ET.SubElement(body, "replicate", count="2", offset="0.1 0 0", sep="-")
            self.inertia(
                ET.SubElement(copies, "body", name=f"payload{number}", pos=self.numbers(3, 0.1))
            )
        if length > 1:
            self.limb(body, length - 1)
        else:
            kind = self.rng.choice(["site", "geom"])
            end = ET.SubElement(
                body, kind, name=f"foot{number}", pos=self.numbers(3, 0.1), **self.turn()
            )
            if kind == "geom":
                end.set("size", "0.02 0.02 0.02")
            self.feet.append(f"foot{number}")

    def joint(self, body, name):
        joint = ET.SubElement(
            body, "joint", name=name, pos=self.numbers(3, 0.1), axis=self.numbers(3)
        )
        kind = str(self.rng.choice(["hinge", "hinge", "slide", "class"]))
        if kind == "class":  # and its axis and range
            del joint.attrib["axis"]
        else:
            joint.set("type", kind)
            low, high = sorted(self.rng.uniform(-2.0, 2.0, 2))
            joint.set("range", self.angles(low, high) if kind == "hinge" else f"{low} {high}")
            if self.yes(0.3):
                joint.set("limited", "false")
        if self.yes(0.3):
            joint.set("ref", "0.4")
        if self.yes(0.3):
            joint.set("actuatorfrcrange", "-7 9")
        self.joints.append(name)

    def actuators(self):
        found = ET.Element("actuator")
        for name in self.joints if self.yes() else ():
            kind = str(self.rng.choice(["motor", "motor", "position"]))
            more = {"armature": "0.003", "damping": "0.2"} if self.yes() else {}
            motor = ET.SubElement(
                found, kind, joint=name, gear=str(self.rng.choice([-3.0, 0.5, 8.0])), **more
            )
            for limit in ("ctrlrange", "forcerange"):
                if self.yes():
                    motor.set(limit, f"{-self.rng.uniform(1.0, 5.0)} {self.rng.uniform(1.0, 5.0)}")
        tied = self.yes(0.05) and not self.refused
        equality = ET.Element("equality")
        ET.SubElement(
            equality, "weld", body1="base", body2="door", active="true" if tied else "false"
        )
        self.refused = "<weld>" if tied else self.refused
        return [found, equality]
