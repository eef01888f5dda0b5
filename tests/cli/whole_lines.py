#!/usr/bin/env python3
"""whole_lines.py COMMAND MODEL: `ebpo COMMAND MODEL` writes results as whole lines, also when it is interrupted.

Standard output is a pipe that keeps separate writes apart (O_DIRECT). Each write must end with a line. Then
SIGTERM ends the program.
"""
import itertools
import os
import signal
import subprocess
import sys
import threading

PIECES = 200


def run_query(stream):
    try:
        for i in itertools.count():
            stream.write(f"{i % 977 / 100} {i % 13 / 7} "
                         f"{i % 89 / 31}{' -1 0 0' if sys.argv[1] == 'ray' else ''}\n".encode())
    except (BrokenPipeError, ValueError):
        pass


results, theirs = os.pipe2(os.O_DIRECT)
process = subprocess.Popen(["ebpo", *sys.argv[1:]], stdin=subprocess.PIPE, stdout=theirs)
os.close(theirs)
writer = threading.Thread(target=run_query, args=[process.stdin], daemon=True)
writer.start()
broken = 0
for number in itertools.count():
    piece = os.read(results, 1 << 16)
    if not piece:
        break
    broken += not piece.endswith(b"\n")
    if number == PIECES:
        process.send_signal(signal.SIGTERM)
code = process.wait(timeout=60)
print("fine" if code == -signal.SIGTERM and not broken and number > PIECES
      else f"code {code}, {broken} of {number} pieces end within a line")
