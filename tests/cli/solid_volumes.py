"""solid_volumes.py EBPO [ROUNDS]: compares volumes that commands print with the volume of the set that the
winding rule defines. The models are boxes at integer coordinates, counted in a voxel grid: nested, repeated,
overlapping, touching and reversed boxes.
"""
import itertools
import json
import math
import random
import subprocess
import sys

SIZE = 12
INSIDE = {"nonzero": lambda w: w != 0, "positive": lambda w: w > 0, "evenodd": lambda w: w % 2 == 1}
SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def write_ply(name, boxes):
    vertices, faces = [], []
    for low, high, sign in boxes:
        first = len(vertices)
        vertices += [[(low, high)[i >> k & 1][k] for k in range(3)] for i in range(8)]
        for a, b, c, d in SIDES:
            for face in ((a, b, c), (a, c, d)):
                faces.append([first + v for v in (face if sign > 0 else face[::-1])])
    with open(name, "w", encoding="ascii") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
                  f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
        out.writelines(" ".join(map(str, v)) + "\n" for v in vertices)
        out.writelines("3 " + " ".join(map(str, f)) + "\n" for f in faces)


def windings(boxes):
    """Returns the winding number of each voxel."""
    w = dict.fromkeys(itertools.product(range(SIZE), repeat=3), 0)
    for low, high, sign in boxes:
        for voxel in itertools.product(*(range(a, b) for a, b in zip(low, high))):
            w[voxel] += sign
    return w


def are_apart(boxes):
    """Returns True when no two boxes have a common point of their surfaces."""
    def within(a, b):
        return all(b[0][k] < a[0][k] and a[1][k] < b[1][k] for k in range(3))
    def away(a, b):
        return any(a[1][k] < b[0][k] or b[1][k] < a[0][k] for k in range(3))
    return all(away(a, b) or within(a, b) or within(b, a) for a, b in itertools.combinations(boxes, 2))


def run(*args):
    done = subprocess.run([sys.argv[1], *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{args}: {done.stderr}")
    return json.loads(done.stdout)


def check(where, printed, volume, integral, known):
    def near(a, b):
        return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-9)
    if printed["volume"] is not None and not near(printed["volume"], volume):
        sys.exit(f"{where}: printed volume {printed['volume']}, the set has {volume}")
    if printed["volume_lo"] > volume + 1e-9 or (printed["volume_hi"] or math.inf) < volume - 1e-9:
        sys.exit(f"{where}: printed {printed['volume_lo']} to {printed['volume_hi']}, the set has {volume}")
    if not near(printed["winding_integral"], integral):
        sys.exit(f"{where}: printed integral {printed['winding_integral']}, expected {integral}")
    if known and printed["volume"] is None:
        sys.exit(f"{where}: the volume is reported as unknown, although shells are apart; expected {volume}")


def judge(boxes, rule, name):
    write_ply(name + ".ply", boxes)
    w = windings(boxes)
    volume, integral = sum(INSIDE[rule](x) for x in w.values()), sum(w.values())
    apart = are_apart(boxes)
    file = name + ".ebpo.h5"
    made = run("convert", "--json", "--rule", rule, name + ".ply", file)
    report = dict(made["report"])
    check(f"convert {boxes} {rule}", report, volume, integral, apart)
    check(f"info {boxes} {rule}", run("info", "--json", file)["report"], volume, integral, len(boxes) == 1)
    mass = run("measure", "--json", file)
    check(f"measure {boxes} {rule}", mass, volume, integral, apart)
    if rule == "nonzero":
        check(f"check {boxes}", run("check", "--json", name + ".ply")["report"], volume, integral, apart)
    last = made["levels"][-1]
    if last.get("percent_of_solid") is not None and last["percent_of_solid"] < 100 - 1e-6:
        sys.exit(f"{boxes} {rule}: envelopes of {last['percent_of_solid']} % of the solid")
    if mass["volume"]:  # the centroid of the set
        inside = [v for v, x in w.items() if INSIDE[rule](x)]
        for k in range(3):
            middle = sum(v[k] + 0.5 for v in inside) / len(inside)
            if not math.isclose(mass["centroid"][k], middle, abs_tol=1e-9):
                sys.exit(f"{boxes} {rule}: centroid {mass['centroid']}, expected {middle} along axis {k}")
        trace = sum(2 * sum((v[k] + 0.5 - mass["centroid"][k]) ** 2 + 1 / 12 for k in range(3)) for v in inside)
        if not math.isclose(sum(mass["inertia"][k][k] for k in range(3)), trace, rel_tol=1e-9):
            sys.exit(f"{boxes} {rule}: the trace of inertia is not {trace}")
    return apart


def twice_around(name):
    """Writes the unit cube as one closed 2-manifold that runs around its sides twice."""
    lap = [(0, 0), (1, 0), (1, 1), (0, 1)] * 2
    vertices = [(x, y, z) for z in (0, 1) for x, y in lap] + [(0.5, 0.5, 0), (0.5, 0.5, 1)]
    faces = []
    for i in range(8):
        k = (i + 1) % 8
        faces += [(16, k, i), (17, 8 + i, 8 + k), (i, k, 8 + k), (i, 8 + k, 8 + i)]
    with open(name, "w", encoding="ascii") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty double x\nproperty double y\n"
                  f"property double z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
        out.writelines(" ".join(map(str, v)) + "\n" for v in vertices)
        out.writelines("3 " + " ".join(map(str, f)) + "\n" for f in faces)


def judge_twice_around():
    twice_around("around.ply")
    made = run("convert", "--json", "around.ply", "around.ebpo.h5")["report"]
    for where, printed in (("convert", made), ("check", run("check", "--json", "around.ply")["report"]),
                           ("info", run("info", "--json", "around.ebpo.h5")["report"]),
                           ("measure", run("measure", "--json", "around.ebpo.h5"))):
        check(f"{where} of a cube that runs around itself twice", printed, 1, 2, False)
        if printed["volume"] is not None:
            sys.exit(f"{where} of a cube that runs around itself twice: a volume was printed")
    if made["components"] != 1 or not made["manifold"]:
        sys.exit("the cube that runs around itself twice is not a 2-manifold with one component")


def box(low, high, sign=1):
    return ((low,) * 3, (high,) * 3, sign)


def random_boxes(chance):
    boxes = []
    for _ in range(chance.randint(1, 6)):
        low = [chance.randrange(SIZE - 1) for _ in range(3)]
        high = [chance.randint(a + 1, min(SIZE, a + 6)) for a in low]
        boxes.append((tuple(low), tuple(high), chance.choice((1, 1, -1))))
        if chance.random() < 0.1:
            boxes.append((*boxes[-1][:2], chance.choice((1, -1))))
    return boxes


def nested_boxes(chance):
    return [box(i, SIZE - i, chance.choice((1, -1))) for i in range(chance.randint(2, 6))]


def main():
    chance = random.Random(32)
    cases = [[box(0, 1)], [box(0, 1, -1)], [box(0, 1), box(0, 1)], [box(0, 1), box(0, 1, -1)],
             [box(0, 10), box(3, 7)], [box(0, 10), box(3, 7, -1)], [box(0, 10, -1), box(3, 7)],
             [box(0, 4), box(2, 6)], [box(0, 4), box(4, 8)], [box(0, 4), box(5, 9)],
             [box(0, 10), box(1, 9, -1), box(2, 8)], [box(0, 10), box(1, 9), box(2, 8, -1), box(3, 7, -1)]]
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    cases += [nested_boxes(chance) for _ in range(rounds)] + [random_boxes(chance) for _ in range(3 * rounds)]
    known = 0
    judge_twice_around()
    for i, boxes in enumerate(cases):
        for rule in INSIDE:
            known += judge(boxes, rule, f"voxels{i % 2}")
    print("right" if known > len(cases) else f"only {known} of {3 * len(cases)} are apart")


if __name__ == "__main__":
    main()
