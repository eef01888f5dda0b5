#!/usr/bin/env python3
"""query_threads.py EBPO EBPO-GENERATE [SHARE]: checks that every query gives the same bytes on 1 to 8 threads, with
the whole model in memory, with parts of it, and with the default. No command waits for ever. The results for a
block or a row are longer than the buffers. SHARE: only 8 threads, and one of SHARE rows.
"""
import os
import random
import subprocess
import sys
import tempfile

FINE, COARSE, CATALOGUE = "fine.ebpo.h5", "models/coarse.ebpo.h5", "models/catalogue.json"
# First entry: the command begins with parts of FINE and may load the whole model later. Numbers: multiples of
# the least memory for the model.
MEMORY = {FINE: ["", "1G"], COARSE: [1.02, 1.5], CATALOGUE: ["", 2.1]}
HUNG = 240


def rows_of(count, width, seed):
    """Returns points near the torus, with a direction (6 numbers) or as boxes."""
    r = random.Random(seed)
    for _ in range(count):
        p = [r.uniform(-1.4, 1.4), r.uniform(-1.4, 1.4), r.uniform(-0.4, 0.4)]
        yield p if width == 3 else p + [r.uniform(-1, 1) for _ in range(3)] if width == 7 else p + [
            x + 0.3 for x in p]


def write(name, rows):
    with open(name, "w") as file:
        file.writelines(" ".join(f"{x:.17g}" for x in row) + "\n" for row in rows)


def make_inputs(ebpo, generate, share):
    def run(*command):
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)

    run(generate, "--base", "torus", "--faces", "10000", "torus.ply")
    # so many nodes that the command does not load the whole model at once
    run(ebpo, "convert", "-q", "--leaf-faces", "1", "--max-level", "8", "--parts", "-envelopes", "torus.ply", FINE)
    os.mkdir("models")
    run(ebpo, "convert", "-q", "torus.ply", COARSE)
    run(generate, "--base", "sphere", "--faces", "4000", "sphere.ply")
    run(ebpo, "convert", "-q", "sphere.ply", "models/sphere.ebpo.h5")
    run(ebpo, "catalogue", "-q", "models")
    write("points.txt", rows_of(8000 // share, 3, 1))
    write("few.txt", rows_of(3000 // share, 3, 2))
    write("rays.txt", rows_of(6000 // share, 7, 3))
    write("boxes.txt", rows_of(4000 // share, 6, 4))
    write("rows.txt", rows_of(6, 3, 5))  # all faces for each row, more than 1 MB of text
    write("one_place.txt", ([0.1, 0.2, 0.3] for _ in range(10000 // share)))  # long results of equal size


LISTS = [
    (["distance", "-k", "40"], "points.txt"),
    (["distance", "--within", "0.2", "--json"], "few.txt"),
    (["distance", "--within", "9"], "rows.txt"),
    (["ray", "--all", "--json"], "rays.txt"),
    (["box"], "boxes.txt"),
]
QUERIES = [
    (["inside"], "points.txt"),
    (["distance", "--json"], "one_place.txt"),
    (["ray"], "rays.txt"),
]


def least_memory(ebpo, model):
    """Returns the bytes that the model needs according to the command."""
    command = [ebpo, "inside", "--memory", "1", model, "points.txt"]
    messages = subprocess.run(command, capture_output=True, text=True).stderr
    return int(messages.split("give at least")[1].split()[0])


def results_of(command, path):
    """Returns the exit code, results and messages; 'hung' after a time limit."""
    with open(path) as rows:
        try:
            done = subprocess.run(command, stdin=rows, capture_output=True, timeout=HUNG)
        except subprocess.TimeoutExpired:
            return "hung", b"", b""
    return done.returncode, done.stdout, done.stderr


def compare(ebpo, model, query, path, threads):
    """Returns the problems of the results for the rows of `path`, one line for each."""
    command = [ebpo, query[0], model, *query[1:]]
    right = results_of(command + ["--threads", "1", "--memory", "1G"], path)
    if right[0] != 0 or right[2]:
        yield f"{' '.join(command)}: {right[0]}, {right[2].decode()}"
    for memory in MEMORY[model]:
        if isinstance(memory, float):
            memory = str(int(memory * least_memory(ebpo, model)))
        for n in threads if memory == "" else (8,):
            how = ["--threads", str(n)] + (["--memory", memory] if memory else [])
            found = results_of(command + how, path)
            if found != right:
                yield (f"{' '.join(command + how)} <{path}: {found[0]}, {len(found[1])} bytes of results, "
                       f"expected {len(right[1])}; {found[2].decode()[-2000:]}")


def main():
    ebpo, generate = (os.path.abspath(path) for path in sys.argv[1:3])
    share = int(sys.argv[3]) if sys.argv[3:] else 1
    threads = (8,) if share > 1 else range(1, 9)
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        make_inputs(ebpo, generate, share)
        for model in MEMORY:
            for query, path in QUERIES + (LISTS if model != CATALOGUE else []):
                wrong += compare(ebpo, model, query, path, threads)
        os.chdir("/")
    sys.exit("\n".join(wrong) or 0)


main()
