#!/usr/bin/env python3
"""killed_shard.py MODEL: a shard that is killed while it runs leaves no results, and the same command writes
them afterwards. After SIGTERM no files remain, nor after a shard whose points changed while it ran.

Points are zeros, in a file without blocks on disk; there are more of them when the shard finished too early.
"""
import glob
import os
import signal
import subprocess
import sys
import time

OUT, HIDDEN = "killed.out", ".killed.out.*.tmp"


def begun(model, points):
    """Returns the process when its hidden file has results; None when the process finished before."""
    running = subprocess.Popen(["ebpo", "inside", "--raw", "--threads", "1", "--shard", "1/2", "-o", OUT,
                                model, points])
    while running.poll() is None:
        if any(os.path.getsize(name) for name in glob.glob(HIDDEN)):
            return running
        time.sleep(0.001)
    os.remove(OUT)
    os.remove(OUT + ".shard")
    return None


def end_by(act, code, model, rows):
    while True:
        with open("zeros.raw", "wb") as file:
            file.truncate(24 * rows)
        running = begun(model, "zeros.raw")
        if running:
            act(running)
            if running.wait() == code:
                return rows
            os.remove(OUT)
            os.remove(OUT + ".shard")
        rows *= 2
        if rows > 1 << 28:
            sys.exit("never runs long enough")


def main():
    model = sys.argv[1]
    rows = end_by(lambda running: os.utime("zeros.raw", (1, 1)), 1, model, 1 << 20)
    wrong = glob.glob("killed.out*") + glob.glob(HIDDEN)
    rows = end_by(subprocess.Popen.terminate, -signal.SIGTERM, model, rows)
    wrong += glob.glob("killed.out*") + glob.glob(HIDDEN)
    rows = end_by(subprocess.Popen.kill, -signal.SIGKILL, model, rows)
    wrong += glob.glob("killed.out*") + ["no hidden file"] * (len(glob.glob(HIDDEN)) != 1)
    again = ["ebpo", "inside", "--raw", "--shard", "1/2", "-o", OUT, model, "zeros.raw"]
    subprocess.run(again, check=True)
    wrong += glob.glob(HIDDEN)
    if os.path.getsize(OUT) != 8 * (rows - rows // 2):
        wrong.append(f"{os.path.getsize(OUT)} bytes of results")
    reported = subprocess.run(again, check=True, capture_output=True, text=True).stderr
    if "nothing to do" not in reported:
        wrong.append(reported)
    for name in ("zeros.raw", OUT, OUT + ".shard"):
        os.remove(name)
    print("\n".join(wrong) or "fine")
    return 1 if wrong else 0


sys.exit(main())
