#!/usr/bin/env python3
"""interrupt.py SIGNAL OUT[:FILE] COMMAND...: sends SIGNAL when a temporary file for OUT exists, or a temporary
folder for OUT that has the complete FILE. Prints the exit status of the command and the remaining files.
"""
import os
import signal
import subprocess
import sys
import time


def leftovers(out):
    folder, name = os.path.split(os.path.abspath(out))
    return sorted(f for f in os.listdir(folder) if f.startswith("." + name) or f == name)


def main():
    number, command = getattr(signal, "SIG" + sys.argv[1]), sys.argv[3:]
    out, _, file = sys.argv[2].partition(":")
    signal.signal(number, signal.SIG_DFL)
    process = subprocess.Popen(command)
    while process.poll() is None and not any(not file or os.path.exists(os.path.join(f, file)) for f in leftovers(out)):
        time.sleep(0.002)
    seen = process.poll() is None
    process.send_signal(number)
    code = process.wait(timeout=60)
    print(f"{'interrupted' if seen else 'finished before the signal'}, ended by {-code}, left {leftovers(out)}")


main()
