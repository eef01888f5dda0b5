#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Seeds of the fuzz targets that are not files of others: make_seeds.py FOLDER.

Each is small, and leads into a branch that random bytes do not find soon. The bytes before them are
what the targets' first lines say."""
import pathlib
import struct
import sys
import zlib

folder = pathlib.Path(sys.argv[1])


def put(target, name, data):
    (folder / target).mkdir(parents=True, exist_ok=True)
    (folder / target / name).write_bytes(data)


def fletcher32(data):
    low = high = 0
    for i in range(0, len(data), 2):
        low = (low + (data[i] << 8 | (data[i + 1] if i + 1 < len(data) else 0))) % 65535 or 65535
        high = (high + low) % 65535 or 65535
    return struct.pack("<I", high << 16 | low)


# --- chunks: pipeline, width, direction; rows; bytes ---
raw = bytes(i * 7 % 251 for i in range(48))
packed = zlib.compress(raw)
frames = {  # of the 48 bytes; by the zstd command with --check and the content's size
    "zstd_raw": bytes.fromhex("28b52ffd2430810100") + raw + bytes.fromhex("00000000"),
    "zstd_rle": bytes.fromhex("28b52ffd2430830100") + b"\x07" + bytes.fromhex("00000000"),
}
for width in range(4):
    rows = struct.pack("<H", 48 >> width)
    for name, frame in frames.items():
        put("chunk", f"{name}_{1 << width}", bytes([width << 2]) + rows + frame)
    put("chunk", f"deflate_{1 << width}", bytes([1 | width << 2]) + rows + packed + fletcher32(packed))
    put("chunk", f"checksum_{1 << width}", bytes([2 | width << 2]) + rows + raw + fletcher32(raw))
    put("chunk", f"bare_{1 << width}", bytes([3 | width << 2]) + rows + raw)
    put("chunk", f"made_{1 << width}", bytes([16 | width << 2]) + rows + raw)

# --- codings: which, kind ---
numbers = b"".join(struct.pack("<I", v) for v in (0, 1, 2, 2, 5, 0xfffffffe, 0x80000000, 3, 0, 4, 1, 6))
for coding in range(7):
    for kind in (0, 1, 5, 7, 0x13, 0x1f, 0x2e):
        put("codings", f"{coding}_{kind:02x}", bytes([coding, kind]) + numbers)
fan = b"".join(struct.pack("<III", *face) for face in
               ((0, 0, 0), (3, 1, 0), (4, 1, 0), (5, 1, 0), (5, 1, 4), (2, 1, 0), (0, 0, 0)))
put("codings", "corners_fan", bytes([4, 0]) + fan)
put("codings", "gates_fan", bytes([5, 0]) + fan)
put("codings", "gates_late_fan", bytes([5, 9]) + fan)

# --- responses: flags, where from; lines ---
lines = {
    "part": b"HTTP/1.1 206 Partial Content\r\nContent-Range: bytes 0-99/100000\r\nContent-Length: 100\r\n"
            b"ETag: \"tag\"\r\nLast-Modified: Mon, 23 Nov 2026 09:00:00 GMT\r\n\r\n",
    "whole": b"HTTP/1.1 200 OK\r\nContent-Length: 100000\r\nETag: \"tag\"\r\n\r\n",
    "chunked": b"HTTP/1.1 200 OK\r\nTransfer-Encoding: gzip, chunked\r\n\r\n",
    "http2": b"HTTP/2 200 \r\netag: W/\"x\"\r\n\r\n",
    "encoded": b"HTTP/1.1 200 OK\r\nContent-Encoding: gzip\r\nContent-Length: 9\r\n\r\n",
    "identity": b"HTTP/1.1 206 \r\nContent-Encoding: identity\r\nContent-Range: bytes 0-0/1\r\n\r\n",
    "gone": b"HTTP/1.1 416 Range Not Satisfiable\r\nContent-Range: bytes */1234\r\n\r\n",
    "redirect": b"HTTP/1.1 301 Moved\r\nLocation: /x\r\n\r\nHTTP/1.1 206 Partial\r\n"
                b"Content-Range: bytes 0-9/*\r\n\r\n",
    "later": b"HTTP/1.1 503 Busy\r\nRetry-After: 1\r\n\r\n",
    "absent": b"HTTP/1.1 404 Not Found\r\n\r\n",
    "denied": b"HTTP/1.1 401 Unauthorized\r\n\r\n",
    "two_ranges": b"HTTP/1.1 206 \r\nContent-Range: bytes 0-9/100\r\nContent-Range: bytes 0-8/100\r\n\r\n",
    "long_tag": b"HTTP/1.1 206 \r\nETag: \"" + b"a" * 250 + b"\"\r\n\r\n",
    "huge": b"HTTP/1.1 206 \r\nContent-Range: bytes 0-9/99999999999999999999\r\n\r\n",
    "several": b"HTTP/1.1 206 Partial Content\r\nServer: nginx\r\nETag: \"tag\"\r\n"
               b"Content-Type: multipart/byteranges; boundary=\"mark\"\r\n\r\n\r\n--mark\r\n"
               b"Content-Range: bytes 0-3/100000\r\n\r\nabcd\r\n--mark\r\n"
               b"Content-Range: bytes 0-2/100000\r\n\r\nabc\r\n--mark--\r\n",
    "url": b"https://user:pass@word@example.org/a/b?key=1#x",
}
for name, text in lines.items():
    put("response", name, bytes([0, 0, 0]) + text)
    put("response", name + "_pinned", bytes([1, 0, 0]) + text)
    put("response", name + "_many", bytes([255, 0, 0]) + text)

# --- points: kind and flags; the file ---
doubles = struct.pack("<14d", 0, 1, 2, .5, -1, 1e300, 3, 4, 5, 6, 7, 8, 9, 10)
head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 6), }"
npy = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head + b"\n" + doubles[:96]
flat = b"{'descr': '>f4', 'fortran_order': False, 'shape': (3,), }\n"
files = {
    "text": b"0 1 2\n0.25 -3e-5 +7 # said\n\n1,2,3\n0x1p3 inf 1\n1e400 2 3\n1\t2\t3\r\n",
    "six": b"0 0 0 1 0 0\n0 0 0 1 1 1 0.5\n",
    "names": b"id,x,y,z\n1,2,3,4\n2,3,4,5\n",
    "quoted": b"\"x\";\"y\";\"z\"\n1;2;3\n",
    "direction": b"ox oy oz dx dy dz tmax\n0 0 0 1 0 0 9\n",
    "corners": b"x0\ty0\tz0\tx1\ty1\tz1\n0\t0\t0\t1\t1\t1\n",
    "npy": npy, "npy_flat": b"\x93NUMPY\x02\x00" + struct.pack("<I", len(flat)) + flat + doubles[:12],
    "raw": doubles, "short": b"\x93NUMPY", "cut": doubles[:41],
    "ply": b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
           b"property float z\nend_header\n0 0 0\n1 2 3\n",
}
for name, data in files.items():
    for flags in (0, 1, 2, 4, 5, 6, 8, 9, 10, 16):
        put("points", f"{name}_{flags:02x}", bytes([flags]) + data)

# --- arguments: command or value; the text ---
command_lines = [
    b"in.ply\nout.ebpo.h5\n--max-level\n9\n--selection\nkmedoids\n-q", b"a.ply\n--json", b"a.h5\n--json\n-h",
    b"a.h5", b"a.h5\nview.json\n--camera=1,2,3", b"a.h5\no.ply\n--level=3\n--no-cell-faces",
    b"a.h5\no.vtkhdf\n--levels\n0-3", b"a.h5\nb.h5\n--box\n0,0,0,1,1,1\n--levels\n0-3",
    b"a.h5\nb.h5\n--codec\ndeflate", b"http://x/a.h5\nb.h5\n--box=0,0,0,1,1,1", b"a.h5\n--max-level\n2",
    b"a.h5\no.png\n--width\n640", b"a.h5\n--source\na.ply\n--memory\n64M",
    b"a.h5\n-\n--mode\nnodes-plain\n--deadline=5us", b"a.h5\np.npy\n--unsigned\n--nearest\n3",
    b"a.h5\n--any\n--raw", b"a.h5\n--csv\n--header", b"a.h5\n--points\n1000", b"a.ply\no.html",
    b"report\ns.scene.json", b"A-B\na.h5\nb.h5\n--pose\nB:1 2 3", b"a.h5\nb.h5\n--distance",
    b"a.h5\n-o\nb.h5\n--source\na.ply", b"a.h5\n--plane\nz=50%\n--size\n64x64\n-o\nm.png\n--range=1",
    b"a.h5\n--path\np.txt\n--rate\n1000\n--radius=0.1\n--json",
    b"list\na.paint.h5\n--json"]
for i, text in enumerate(command_lines):
    put("args", f"command_{i:02}", bytes([i]) + text)
values = {
    0: [b"64M", b"1GiB", b"0.5G", b"18446744073709551615", b"16Ei", b"1.5k"],
    1: [b"3", b"0-5", b"3-", b"0,2,4", b"20", b"0-20,3"],
    2: [b"1 2 3", b"1,2,3 0 0 0 1 2", b"1 0 0 5 0 1 0 6 0 0 1 7", b"1 0 0 5 0 1 0 6 0 0 1 7 0.5"],
    3: [b"A", b"A - (B | C)", b"A&B*C^D+E", b"((((A))))", b"A - "],
    4: [b"none", b"1024", b"0"], 5: [b"500ns", b"50us", b"1ms", b"2s"], 6: [b"2G", b"1"],
    7: [b"500", b"1%", b"100%", b"1e9"],
    8: [b"800x600", b"2x8192", b"99999x3"],
    9: [b"0.1", b"-1e-320", b"inf", b"nan", b"0x1.8p3", b"9007199254740993", b"1e400"]}
for kind, texts in values.items():
    for i, text in enumerate(texts):
        put("args", f"value_{kind}_{i}", bytes([64 + kind + (10 * 9 if kind == 3 and i else 0)]) + text)

# --- meshes of others: format and flags; the file ---
obj = (b"mtllib a.mtl\no first\nv 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\nusemtl red\ns 1\n"
       b"f 1 3 2\ng second\nf 1/1/1 2/1/1 4/1/1\nf -4//1 -1//1 -2//1\nf 2 3 4\n")
mtl = b"newmtl red\nKd 1 0 0\nmap_Kd -s 1 1 1 folder/red.png\nmap_Bump -bm 0.3 b.jpg\n"
off = b"OFF\n# a comment\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3 0.5 0.5 0.5\n"
stl = b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n"
faces = ((0, 0, 0, 0, 1, 0, 1, 0, 0), (0, 0, 0, 1, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 1, 0, 1, 0), (1, 0, 0, 0, 1, 0, 0, 0, 1))
binary = b"COLOR=\x80\x40\x20\xff".ljust(80, b"\0") + struct.pack("<I", 4) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *face, 0x8000 | i * 99) for i, face in enumerate(faces))
payload = bytes(80) + struct.pack("<I", 4) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *face, i) + bytes(i) for i, face in enumerate(faces))
for flags in (0, 16):
    put("import", f"stl_two_{flags}", bytes([1 | flags]) + binary + binary)
    put("import", f"stl_payload_{flags}", bytes([1 | flags]) + payload)
    put("import", f"stl_spare_{flags}", bytes([1 | flags]) + payload + b"behind")
    put("import", f"stl_name_{flags}", bytes([1 | flags]) + b"\xef\xbb\xbf" + stl.replace(b"solid x", b"solid facet normal x")
        .replace(b"endfacet", b"endfacet 1 2"))
    put("import", f"off_glued_{flags}", bytes([(18 if flags else 2)]) + off.replace(b"OFF\n# a comment\n", b"\xef\xbb\xbf\t\fOFF"))
    put("import", f"obj_{flags}", bytes([flags]) + obj)
    put("import", f"stl_{flags}", bytes([1 | flags]) + stl)
    put("import", f"stl_binary_{flags}", bytes([1 | flags]) + binary)
    put("import", f"off_{flags}", bytes([(18 if flags else 2)]) + off)
    put("import", f"coff_{flags}", bytes([(18 if flags else 2)]) + b"C" + off.replace(b"0 0 0\n", b"0 0 0 9 9 9 255\n"))
    put("import", f"coff_nan_{flags}", bytes([2 | flags]) + b"C" + off.replace(b"0 0 0\n", b"0 0 0 nan 9 9 255\n"))
put("import", "groups", bytes([24]) + obj)
put("import", "mtl", bytes([4]) + mtl)
put("import", "ply_names", bytes([4]) + b"ply\ncomment TextureFile a b.png\ncomment TextureFile ../x.png\nend_header\n")

# --- surfaces: vertices less 3 and triangles less 1 of two patches; octant, colours; share of the codes ---
# Codes by triangles less 1: bytes of open edges, then numbers, backwards.
codes = {0: bytes(3), 3: bytes([0, 3, 0, 4, 2, 0, 0, 0]), 7: bytes([0, 0, 1, 0, 0, 2, 0, 0, 0, 0])}
for flags in (0, 7, 8, 15):
    for vertices, triangles in ((0, 0), (5, 7), (40, 7), (200, 3)):
        points = b"".join(struct.pack("<3H", i * 2 % 301, i * 14 % 999, i * 34 % 47) for i in range(2 * vertices + 6))
        rest = bytes(i * 31 % 256 for i in range((2 if flags < 8 else 5) * (2 * vertices + 6)))
        put("surface", f"{flags}_{vertices}_{triangles}",
            bytes([vertices, vertices, triangles, triangles, flags, 128]) + points + rest + codes[triangles] * 2)

# --- heads: indexes of chunks in pages, and what lies beyond the first bytes that are read ---
(folder / "head").mkdir(parents=True, exist_ok=True)
try:
    import h5py
    import numpy
except ImportError:
    sys.exit(0)  # the vectors remain


def head(name, paths, filler=0, **how):
    with h5py.File(folder / "head" / (name + ".h5"), "w", libver="latest") as out:
        if filler:
            out["filler"] = numpy.zeros(filler, "u1")
            out.flush()
        for array, width, rows, cols in paths:
            shape, chunks = ((rows, cols), (2, cols)) if cols else ((rows,), (2,))
            made = out.create_dataset(array, data=numpy.ones(shape, f"<u{width}"), chunks=chunks,
                                      **how)
            made.attrs.create("coding", numpy.bytes_("plain"))


head("pages", [("/levels/00/plane_counts", 1, 2600, 0)])
head("pages_filtered", [("/levels/00/plane_counts", 1, 2600, 0)], fletcher32=True)
head("far", [("/levels/00/plane_counts", 1, 40, 0), ("/levels/00/leaf_new", 4, 40, 0),
             ("/mesh/vertices", 4, 40, 3), ("/subtrees/counts", 4, 40, 21)], filler=140000)
head("pages_far", [("/levels/01/leaf_new", 4, 4200, 0)], filler=140000, fletcher32=True)


def changed(name, source, at, value):
    data = bytearray((folder / "head" / (source + ".h5")).read_bytes())
    data[at(data):at(data) + len(value)] = value
    put("head", name + ".h5", bytes(data))


def layout(data):  # its last member is the address of the index; before it are page bits and kind
    return data.index(struct.pack("<Q", data.index(b"FAHD")))


early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
head("implicit", [("/levels/00/plane_counts", 1, 40, 0)], dcpl=early)
head("fixed", [("/levels/00/plane_counts", 1, 40, 0)])
head("fixed_filtered", [("/levels/00/plane_counts", 1, 40, 0)], fletcher32=True)
NOWHERE, BEYOND = b"\xff" * 8, struct.pack("<Q", 1 << 40)
changed("implicit_nowhere", "implicit",
        lambda d: d.index(struct.pack("<Q", d.index(b"\1" * 40))), NOWHERE)
changed("implicit_overflows", "implicit",
        lambda d: d.index(struct.pack("<Q", d.index(b"\1" * 40))), b"\xfe" + b"\xff" * 7)
for name, at in (("index", layout), ("block", lambda d: d.index(b"FAHD") + 16)):
    for where, address in (("nowhere", NOWHERE), ("beyond", BEYOND), ("elsewhere", bytes(8))):
        changed(f"fixed_{name}_{where}", "fixed", at, address)
        changed(f"pages_{name}_{where}", "pages", at, address)
changed("pages_missing", "pages", lambda d: d.index(b"FADB") + 14, b"\x80")
changed("pages_cut", "pages", lambda d: d.index(b"FAHD") + 16, b"\xf0")
changed("entry_nowhere", "fixed", lambda d: d.index(b"FADB") + 14, NOWHERE)
changed("entry_masked", "fixed_filtered", lambda d: d.index(b"FADB") + 14 + 9, b"\1\1\1\1\1")
changed("entry_filtered", "fixed", lambda d: d.index(b"FAHD") + 5, b"\1")
changed("entry_of_13", "fixed_filtered", lambda d: d.index(b"FAHD") + 6, b"\x20")
changed("page_bits", "fixed", lambda d: d.index(b"FAHD") + 7, b"\x11")
for kind in (0, 1, 2, 4, 5):
    changed(f"index_of_kind_{kind}", "fixed", lambda d: layout(d) - 2, bytes([kind]))
changed("layout_3", "fixed", lambda d: d.rindex(b"\4\2", 0, layout(d)), b"\3")
changed("layout_contiguous", "fixed", lambda d: d.rindex(b"\4\2", 0, layout(d)) + 1, b"\1")
changed("layout_cut", "fixed", lambda d: d.rindex(b"\4\2", 0, layout(d)) - 3, b"\6\0")
for name in ("far", "pages_far"):  # with an odd size the target expects headers in the second half
    put("head", name + "_expected.h5", (folder / "head" / (name + ".h5")).read_bytes() + b"\0" *
        (1 + (folder / "head" / (name + ".h5")).stat().st_size % 2))
