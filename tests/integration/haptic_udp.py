"""Tests a haptic device over UDP, untrusted senders of invalid packets, and samples: haptic_udp.py EBPO BRIDGE..."""
import json
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time

PLACE = struct.Struct("<4sHHQQ3d4d")
FEEL = struct.Struct("<4sHHQQ3d3d3d4d3d3dQI3BB")
assert PLACE.size == 80 and FEEL.size == 192


def place(sequence, at=(0.4, 0.5, 3.0), turn=(0, 0, 0, 1), magic=b"EBPT", version=1, kind=1):
    return PLACE.pack(magic, version, kind, sequence, sequence * 7 % 2 ** 64, *at, *turn)


WAITING = 2  # flag: the thread that loads faces has not loaded those that are near
NAN, HUGE = float("nan"), 1e300
NONE = [
    b"", b"EBPT", place(9)[:79], place(9) + b"x", bytes(80), bytes(65000), place(9, magic=b"EBPO"),
    place(9, version=2), place(9, kind=0), place(9, kind=2), place(9, at=(NAN, 0, 0)),
    place(9, at=(HUGE, 0, 0)), place(9, turn=(0, 0, 0, 0)), place(9, turn=(NAN, 0, 0, 1)),
    place(9, turn=(HUGE, 0, 0, 1)), place(9, kind=3), place(9) + bytes(7), place(9) + bytes(9)] + [
    place(9) + struct.pack("<d", pressure) for pressure in (NAN, -0.1, 1.1, HUGE)]


def begin(ebpo, model, *more):
    p = subprocess.Popen([ebpo, "haptic", "--json", "--device", "udp:0", *more, model],
                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    line = p.stderr.readline()
    found = re.search(r"at 127\.0\.0\.1, port (\d+)$", line.strip())
    assert found, line
    return p, ("127.0.0.1", int(found[1]))


def sender():
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.settimeout(1)
    return s


def receive(s, to, packet, sequence):
    """Return the reply for a position. Skip earlier replies; send packets again that a full queue has dropped."""
    tries = 20
    s.sendto(packet, to)
    while True:
        try:
            got = FEEL.unpack(s.recv(4096))
        except socket.timeout:
            assert tries > 0, "no reply"
            tries -= 1
            s.sendto(packet, to)
            continue
        assert got[:3] == (b"EBPT", 1, 2) and got[4] == 7 * got[3], got
        assert got[3] <= sequence, (got[3], sequence)
        if got[3] == sequence:
            return got


CUBE = """ply
format ascii 1.0
element vertex 8
property float x
property float y
property float z
element face 12
property list uchar int vertex_indices
end_header
""" + "".join(f"{i & 1} {i >> 1 & 1} {i >> 2}\n" for i in range(8)) + "".join(
    f"3 {f}\n" for f in ("0 2 3", "0 3 1", "4 5 7", "4 7 6", "0 1 5", "0 5 4", "2 6 7", "2 7 3",
                         "0 4 6", "0 6 2", "1 3 7", "1 7 5"))


def press(device, to, sequence):
    """Press on the cube and send nothing more, as if the device were unplugged. Check that the force decreases to 0.

    Return the sequence number of the last packet."""
    for z in (1.2, 1.05, *[0.95] * 1000):
        got = receive(device, to, place(sequence, at=(0.4, 0.5, z)), sequence)
        sequence += 1
        if z < 1 and got[7] > 0 and not got[25] & WAITING:
            break
    assert got[7] > 10, got
    felt, begin = [], time.monotonic()
    device.settimeout(10)
    while time.monotonic() < begin + 1:
        felt.append(FEEL.unpack(device.recv(4096))[7])
    assert felt == sorted(felt, reverse=True) and felt[0] > 10 and felt[-1] == 0, felt
    return sequence - 1


def bridge(ebpo, model, program):
    """A sample that connects a device of another library presses on the top of the cube, with a force of the device.

    The hand gets at most the energy that it gives, with the tolerance of a motion of 0.6 mm in one step."""
    p, to = begin(ebpo, model, "--seconds", "40", "--stiffness", "1000")
    printed = subprocess.run([program, str(to[1]), "0.4", "1.2", "0.5", "1", "1000"], check=True, stdout=subprocess.PIPE,
                             text=True, timeout=60).stdout
    out, err = p.communicate(timeout=60)
    assert p.returncode == 0 and json.loads(out)["contacts"] > 50, (p.returncode, out, err)
    energy = re.search(r" (frames|positions), last force 0\.00, energy (-?[\d.]+), strongest force up 3\.30\n$", printed)
    assert energy, printed  # 3.3: the greatest force of the stub
    assert float(energy[2]) <= 1000 * 0.0006 ** 2 * 1.0001, printed


def interrupt(ebpo, model, program):
    """SIGINT ends a sample with force 0, and ebpo haptic."""
    p, to = begin(ebpo, model, "--seconds", "40")
    sample = subprocess.Popen([program, str(to[1]), "0.4", "1.2", "0.5", "1", "400"], stdout=subprocess.PIPE, text=True)
    time.sleep(0.6)
    sample.send_signal(signal.SIGINT)
    printed = sample.communicate(timeout=60)[0]
    out, err = p.communicate(timeout=10)
    assert p.returncode == 0 and json.loads(out)["haptic"]["steps"] > 0, (p.returncode, out, err)
    count = re.search(r"(\d+) (frames|positions), last force 0\.00,", printed)
    assert sample.returncode == 0 and int(count[1]) < 1000, (sample.returncode, printed)


def main(ebpo, *bridges):
    with tempfile.TemporaryDirectory() as folder:
        ply, model = folder + "/m.ply", folder + "/m.ebpo.h5"
        with open(ply, "w", encoding="ascii") as out:
            out.write(CUBE)
        subprocess.run([ebpo, "convert", "-q", ply, model], check=True)
        p, to = begin(ebpo, model, "--seconds", "40", "--rate", "500")
        device, other = sender(), sender()
        for packet in NONE:  # before a device is connected
            other.sendto(packet, to)
        first = receive(device, to, place(10), 10)
        assert first[11:14] == (0.4, 0.5, 3.0), first
        for packet in NONE + [place(1 << 63), place(2 ** 64 - 1, kind=3)]:
            other.sendto(packet, to)
        for packet in NONE + [place(10, at=(9, 9, 9)), place(3, kind=3)]:  # packets of the device itself that are wrong or old
            device.sendto(packet, to)
        second = receive(device, to, place(11, at=(0.4, 0.5, 2.5), turn=(0, 0, 0.6, 0.8)), 11)
        assert second[11:14] == (0.4, 0.5, 2.5), second
        other.settimeout(0.1)
        try:
            raise SystemExit("an untrusted sender got a reply: %r" % other.recv(4096))
        except socket.timeout:
            pass
        last = press(device, to, 12)
        device.sendto(place(last + 1, kind=3), to)
        out, err = p.communicate(timeout=60)
        assert p.returncode == 0, (p.returncode, err)

        p, to = begin(ebpo, model, "--seconds", "2")  # no device sends packets, or only untrusted senders
        other.sendto(b"hello", to)
        out, err = p.communicate(timeout=60)
        assert p.returncode == 1 and "no device has sent its position in 2 seconds (1 invalid packets" in err, err
        for program in bridges:
            bridge(ebpo, model, program)
            interrupt(ebpo, model, program)


if __name__ == "__main__":
    main(*sys.argv[1:])
