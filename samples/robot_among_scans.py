#!/usr/bin/env python3
"""robot_among_scans.py FOLDER [FACES]: writes a scene with a robot among scans of FACES faces each (default:
320,000), which ebpo-generate makes. Needs ebpo and ebpo-generate in PATH; ebpo-generate is not installed, but
is in samples/ of the build folder. Equal arguments give equal scenes.

    python3 samples/robot_among_scans.py /tmp/robot
    ebpo scene report --csv --from 0 --to 12 --step 0.5 /tmp/robot/robot.scene.json
    ebpo scene approach --from 0 --to 12 --tolerance 0.001 /tmp/robot/robot.scene.json
    ebpo scene plan /tmp/robot/robot.scene.json
    ebpo scene pack -o /tmp/robot/packed /tmp/robot/robot.scene.json

The base drives past rough boulders and through a rough ring. The arm turns, and the hand turns with the arm.
The hand has a clearance of 2 cm."""
import json
import math
import os
import subprocess
import sys

SCANS = {"boulder": ["--base", "sphere", "--relief", "0.2"],
         "ring": ["--base", "torus", "--relief", "0.05"],
         "hand": ["--base", "sphere", "--relief", "0.1", "--seed", "7"],
         "arm": ["--base", "torus"]}


def turn(angle, axis):
    """Returns the quaternion of a rotation about an axis."""
    half = angle / 2
    return [c * math.sin(half) for c in axis] + [math.cos(half)]


def drive(time):
    """Returns the position of the base at a time; it moves along the y axis."""
    return [0.1 * math.sin(time / 2), -6 + time, 0]


def routes():
    base, arm = [], []
    for i in range(25):
        time = i / 2
        at = drive(time)
        base.append({"time": time, "pose": {"translation": at}})
        arm.append({"time": time, "pose": {"translation": [at[0], at[1], 0.3],
                                           "quaternion": turn(i * math.pi / 4, [0, 0, 1])}})
    return {"base": {"keys": base}, "arm": {"keys": arm}}


def instance(name, model, translation, scale, **more):
    return {"name": name, "model": model, "pose": {"translation": translation, "scale": scale},
            **more}


def scene():
    scans = [instance(f"boulder {i}", "boulder", [1.15 - 2.3 * (i % 2), 2 * i - 5, 0.1 * i], 0.55,
                      layer="scans", fixed=True) for i in range(6)]
    ring = instance("ring", "ring", [0, 0, 0.1], 1.2, layer="scans", fixed=True)
    ring["pose"]["quaternion"] = turn(math.pi / 2, [1, 0, 0])
    robot = [instance("base", "hand", [0, 0, 0], 0.2, layer="robot", route="base"),
             instance("arm", "arm", [0.3, 0, 0], 0.2, layer="robot", route="arm"),
             instance("hand", "hand", [0.62, 0, 0], 0.08, layer="robot", groups=["hands"],
                      route="arm")]
    return {
        "ebpo_scene": "1.0", "title": "A robot among scans", "unit": "m",
        "models": {m: {"file": f"{m}.ebpo.h5"} for m in SCANS},
        "layers": ["scans", "robot"], "groups": ["hands"], "routes": routes(),
        "instances": [*scans, ring, *robot],
        "cameras": [{"name": "above", "eye": [0, 0, 14], "target": [0, 0, 0], "up": [0, 1, 0]},
                    {"name": "on the robot", "eye": [0, -0.5, 0.6], "target": [0, 3, 0.3],
                     "route": "base"}],
        "ignore": [["layer:robot", "layer:robot"]],
        "clearance": [{"between": ["group:hands", "layer:scans"], "distance": 0.02}]}


def run(*command, **how):
    try:
        subprocess.run(command, check=True, **how)
    except FileNotFoundError:
        sys.exit(f"robot_among_scans.py: {command[0]} is not in PATH; ebpo-generate is in samples/ and "
                 "ebpo in tools/ of the build folder (build-quick, build)")
    except subprocess.CalledProcessError:
        sys.exit(1)


def main():
    folder = sys.argv[1]
    faces = sys.argv[2] if len(sys.argv) > 2 else "320000"
    os.makedirs(folder, exist_ok=True)
    for name, how in SCANS.items():
        mesh, out = (os.path.join(folder, name + end) for end in (".ply", ".ebpo.h5"))
        run("ebpo-generate", "--faces", faces, *how, mesh, stdout=subprocess.DEVNULL)
        run("ebpo", "convert", "--quiet", mesh, out)
    with open(os.path.join(folder, "robot.scene.json"), "w", encoding="utf-8") as f:
        json.dump(scene(), f, indent=1)
        f.write("\n")


main()
