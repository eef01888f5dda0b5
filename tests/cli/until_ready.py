"""until_ready.py COMMAND...: sends SIGTERM to a server when it has printed its first line.

Prints the server's output, and ends with its exit code, or with 100 plus the number of the signal that ended it.
"""
import subprocess
import sys

with subprocess.Popen(sys.argv[1:], stdout=subprocess.PIPE) as server:
    first = server.stdout.readline()
    server.terminate()
    sys.stdout.buffer.write(first + server.stdout.read())
sys.exit(server.returncode if server.returncode >= 0 else 100 - server.returncode)
