"""Tests a 3D mouse, with a stub of the daemon spacenavd: haptic_mouse.py EBPO."""
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
from haptic_udp import CUBE

EVENT = struct.Struct("=8i")


def motion(x=0, y=0, z=0, rx=0, ry=0, rz=0):
    return EVENT.pack(0, x, y, z, rx, ry, rz, 16)


def play(ebpo, folder, send, paint, *more):
    """Run ebpo haptic while send(connection) sends events. Return its report and the recorded poses."""
    path = os.path.join(folder, "mouse")
    daemon = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    daemon.bind(path)
    daemon.listen()
    record = os.path.join(folder, "record")
    paint = os.path.join(folder, paint)
    p = subprocess.Popen([ebpo, "haptic", "--json", "--device", "spacenav", "--record", record, "--paint", paint,
                          "--pen-radius", "0.02", *more, os.path.join(folder, "cube.ebpo.h5")],
                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "SPNAV_SOCKET": path})
    daemon.settimeout(20)
    connection = daemon.accept()[0]
    while not os.path.exists(paint):  # made before the first step
        time.sleep(0.02)
    time.sleep(0.2)
    send(connection)
    out, err = p.communicate(timeout=60)
    daemon.close()
    os.remove(path)
    assert p.returncode == 0 and err == "", (p.returncode, err)
    with open(record, encoding="ascii") as lines:
        return json.loads(out), [[float(x) for x in line.split()] for line in lines]


def push(connection, still=1.5):
    """Press down on the front of the cube, in events whose bytes arrive in pieces, turn, then hold the cap still.

    The test holds if only half of the pressing is felt: on a busy machine, the loop may begin after the first events.
    """
    for i in range(200):
        event = motion(z=350)
        connection.sendall(event[:i % 32])
        time.sleep(0.005)
        connection.sendall(event[i % 32:])
        time.sleep(0.005)
    for _ in range(20):
        connection.sendall(motion(ry=-350))
        time.sleep(0.01)
    connection.sendall(motion(x=2 ** 31 - 1))  # the fastest motion is 350
    time.sleep(still)  # the daemon sends changes only
    connection.sendall(motion())
    connection.close()


def main(ebpo):
    with tempfile.TemporaryDirectory() as folder:
        ply = os.path.join(folder, "cube.ply")
        with open(ply, "w", encoding="ascii") as out:
            out.write(CUBE)
        subprocess.run([ebpo, "convert", "-q", ply, os.path.join(folder, "cube.ebpo.h5")], check=True)
        got, poses = play(ebpo, folder, push, "p.paint.h5", "--seconds", "40")
        first, last = poses[0], poses[-1]
        assert first[:2] == last[1:2] * 2 and 1 < first[2] < 1.2 and first[3:] == [0, 0, 0, 1], first
        assert got["contacts"] > 100 and got["paint"]["strokes"] == 1 and last[2] < 0.9, (got, last)
        moved = last[0] - first[0]  # a quarter of the diagonal in a second; the deflection has a limit
        assert 0.25 * 1.73 * 1.4 < moved < 0.25 * 1.74 * 4, (first, last)
        assert last[3] == last[5] == 0 and last[4] < -0.02, last

        def lift(connection):  # a button lifts the pen
            connection.sendall(EVENT.pack(1, 0, 1, 0, 0, 0, 0, 0) + EVENT.pack(2, 0, 0, 0, 0, 0, 0, 0))
            push(connection, 0.1)

        got, poses = play(ebpo, folder, lift, "q.paint.h5", "--seconds", "40")
        assert got["contacts"] > 100 and got["paint"]["strokes"] == 0, got["paint"]
        none = os.path.join(folder, "none.paint.h5")  # not made without a daemon
        p = subprocess.run([ebpo, "haptic", "--device", "spacenav", "--paint", none, "--pen-radius", "0.02",
                            os.path.join(folder, "cube.ebpo.h5")], check=False, stderr=subprocess.PIPE, text=True,
                           env={**os.environ, "SPNAV_SOCKET": folder + "/none"})
        assert p.returncode == 1 and "none: the 3D mouse cannot be read: No such file or directory; " in p.stderr, p
        assert not os.path.exists(none), "a paint file without a device"


main(*sys.argv[1:])
