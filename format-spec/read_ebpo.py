#!/usr/bin/env python3
"""A second reader of .ebpo.h5 files, for README.md and the annexes: h5py and numpy only, none of the library's code.

    read_ebpo.py FILE [EXPECTED.json]
    read_ebpo.py --vectors FOLDER

Prints the file as JSON (as vectors/passed/*.json), or compares with what is expected; of a folder, every file with
its .json and .nodes.json. Checks the content checksum.
"""
import hashlib
import json
import pathlib
import sys

import h5py
import numpy as np


def unzigzag(v):
    """0, 1, 2, 3 ... to 0, -1, 1, -2 ... (as signed integers of the same width)."""
    return ((v >> 1) ^ (0 - (v & 1))).astype(v.dtype.str.replace("u", "i"))


def in_chunks(dataset):
    """Pieces that start anew: the chunks."""
    rows = dataset.chunks[0]
    for row in range(0, dataset.shape[0], rows):
        yield dataset[row:row + rows]


def delta(dataset):
    """coding "delta" of vertices and maps: running sums within a chunk, wrapping."""
    return np.concatenate([np.cumsum(unzigzag(part), axis=0, dtype=unzigzag(part).dtype) for part in in_chunks(dataset)])


def vertices(dataset):
    ordered = delta(dataset)
    mask = np.iinfo(ordered.dtype).max
    bits = np.where(ordered < 0, ordered ^ mask, ordered)
    return bits.view("f4" if bits.itemsize == 4 else "f8")


def gates_of_chunk(data, seen):
    """coding "gates": the corners of a chunk's faces, and how many vertices were seen then."""
    n = len(data) // 13
    if data[0] == 1:
        codes = np.frombuffer(data[1:1 + 12 * n], "u1").reshape(4, 3 * n).T.copy().view("<u4").ravel()
        assert not any(data[1 + 12 * n:]) and len(codes) == 3 * n
        out = []
        for code in codes.tolist():
            assert code <= seen, "a code above seen"
            out.append(seen - code)
            seen += code == 0
        return out, seen
    gates = data[:n]
    thirds = data[n:n + sum(gate != 0 for gate in gates)]
    low = n + len(thirds)
    more = low + 3 * (n - len(thirds)) + sum(third // 3 == 3 for third in thirds)
    third, edges, out = iter(thirds), [], []

    def number():
        nonlocal low, more, seen
        value = data[low]
        low += 1
        assert value <= 240, "a byte of no number"
        if value >= 224:
            size = 4 if value == 240 else 1
            assert more + size <= len(data), "streams too long"
            rest = int.from_bytes(data[more:more + size], "little")
            more, value = more + size, rest if value == 240 else 224 + 256 * (value - 224) + rest
        assert value <= seen, "a number above seen"
        vertex = seen - value
        seen += value == 0
        return vertex

    def push(edge):
        edges.append(edge)
        if len(edges) > 64:
            del edges[0]

    def pass_(a, b):
        for i in range(len(edges) - 1, max(len(edges) - 33, -1), -1):
            if edges[i] == (a, b):
                del edges[i]
                return
        push((b, a))

    def newest(end, vertex):
        return next(i for i in range(len(edges) - 1, -1, -1) if edges[i][end] == vertex)

    for gate in gates:
        if gate == 0:
            f = [number(), number(), number()]
            for k in range(3):
                push((f[(k + 1) % 3], f[k]))
            out += f
            continue
        assert gate <= len(edges), "a gate beyond the list"
        a, b = edges.pop(-gate)
        t, k = divmod(next(third), 3)
        assert t < 4 + len(edges), "a corner beyond the list"
        if t == 0:
            c, seen = seen, seen + 1
            push((c, b))
            push((a, c))
        elif t == 1:
            c = edges.pop(newest(0, b))[1]
            pass_(c, a)
        elif t == 2:
            c = edges.pop(newest(1, a))[0]
            pass_(b, c)
        else:
            c = number() if t == 3 else edges[-1 - (t - 4)][0]
            pass_(b, c)
            pass_(c, a)
        f = [a, b, c]
        out += f[-k:] + f[:-k]
    assert not any(data[more:]), "bytes behind the streams"
    return out, seen


def from_gates(dataset):
    """Corners, in one row. A chunk begins by itself, but for the vertices seen before it."""
    out, seen = [], 0
    for part in in_chunks(dataset):
        corners, seen = gates_of_chunk(part.tobytes(), seen)
        out += corners
    return np.array(out, "i8")


def is_gates(dataset):
    return text(dataset.attrs["coding"]) == "gates"


def high_water(dataset):
    """The codes that faces have, or would have without gates."""
    if not is_gates(dataset):
        return dataset[...]
    corners = from_gates(dataset)
    before = np.maximum.accumulate(np.concatenate([[-1], corners[:-1]])) + 1
    return (before - corners).astype("u4").reshape(-1, 3)


def faces(dataset):
    """coding "high-water": 0 is the next vertex never seen before, k the k-th before that one."""
    if is_gates(dataset):
        return from_gates(dataset).astype("u4")
    codes = dataset[...].ravel().astype("i8")
    new = codes == 0
    seen = np.cumsum(new) - new
    return (seen - codes).astype("u4")


def leaf_first(level):
    """coding "skips": new faces of other levels' leaves in between."""
    skip, new = level["leaf_skip"][...].astype("u8"), level["leaf_new"][...].astype("u8")
    return np.cumsum(skip + new) - new


def leaf_refs(level, first):
    """coding "gap": from the leaf's first new face downwards; ascending here."""
    counts = level["leaf_ref_count"][...].astype("i8")
    if counts.sum() == 0:
        return None
    steps = level["leaf_refs"][...].astype("i8") + 1
    total = np.cumsum(steps)
    begin = np.cumsum(counts) - counts
    leaf = np.repeat(np.arange(len(counts)), counts)
    before = np.concatenate([[0], total])[begin]
    values = first.astype("i8")[leaf] - (total - before[leaf])
    order = np.lexsort((values, leaf))
    return values[order].astype("u4")


def arrays(file):
    """README.md, sections 6 and 9: {path: dataset}, of those that the head calls for; what else stands there is ignored."""
    listed_parts = parts_of(file)
    mesh, planes, leaf_planes, colours, border = (part in listed_parts for part in
                                                  ("mesh", "planes", "leaf-planes", "colours", "border"))
    out, groups, attrs = {}, 1, file.attrs
    for number in range(one(attrs["level_count"])):
        path = f"/levels/{number:02d}"
        level = file[path]
        s = {name: one(value) for name, value in level.attrs.items()}
        solid = text(attrs["kind"]) == "solid"
        rows = {"types": groups, "plane_counts": planes * s["gray"], "planes": planes * s["planes"],
                "leaf_winding": (solid or border) * s["leaf"], "black_winding": solid * s["black"],
                "white_winding": (solid or border) * s["white"],
                "leaf_skip": mesh * s["leaf"], "leaf_new": mesh * s["leaf"], "leaf_ref_count": mesh * s["leaf"],
                "leaf_refs": mesh * s["faces_referenced"], "types_index": groups > 4096, "gray_index": planes and s["gray"] > 4096,
                "leaf_index": (mesh or leaf_planes) and s["leaf"] > 4096,
                "leaf_plane_counts": leaf_planes * s["leaf"], "leaf_planes": leaf_planes * s["leaf_planes"],
                "gray_colours": colours * s["gray"]}
        out.update({f"{path}/{name}": level[name] for name, count in rows.items()
                    if count and (name not in ("black_winding", "white_winding") or name in level)})
        groups = s["gray"]
    several = one(attrs["face_count"]) > (2048 if "subtrees" in listed_parts else 4096)
    names = ["/mesh/vertices", "/mesh/faces"] + ["/mesh/faces_index"] * several if mesh else []
    names += ["/maps/vertex_source", "/maps/face_source"] if "maps" in listed_parts else []
    names += ["/border/loops", "/border/points"] if border and one(attrs["border_loops"]) else []
    if "surface" in listed_parts:
        names += [f"/surface/{name}" for name in ("patches", "triangles", "points", "normals")]
        names += ["/surface/colours"] if one(attrs["surface_colours"]) else []
    if "subtrees" in listed_parts:
        names += ["/subtrees/index", "/subtrees/counts", "/subtrees/chunk_directory"]
        names += ["/subtrees/shared_chunks"] * ("shared_chunks" in file["/subtrees"])
        names += ["/subtrees/checksums"] * (checksum_list(file) == "/subtrees/checksum_index")
    out.update({name: file[name] for name in names})
    return out


def level_arrays(file, number):
    """The same of one level, by their names there."""
    folder = f"/levels/{number:02d}/"
    return {path[len(folder):]: dataset for path, dataset in arrays(file).items() if path.startswith(folder)}


CODINGS = {"leaf_skip": ("skips", "delta"), "leaf_refs": ("gap",), "mesh/vertices": ("delta",), "mesh/faces": ("high-water",),
           "maps/vertex_source": ("delta",), "maps/face_source": ("delta",),
           "border/points": ("delta",)}


def check_codings(file):
    """README.md, section 9: each array names the one that it has. `delta` at leaf_skip is of older files."""
    gates = "gates" in parts_of(file)
    for path, item in arrays(file).items():
        wanted = path.split("/")[-1] if path.startswith("/levels/") else path[1:]
        known = ("gates",) if gates and path == "/mesh/faces" else CODINGS.get(wanted, ("plain",))
        assert text(item.attrs["coding"]) in known, f"{path}: its coding"


def full_rows(dataset):
    """Rows of a chunk without the part `subtrees`."""
    row, rows = dataset.dtype.itemsize * int(np.prod(dataset.shape[1:])), 1
    while 2 * rows * row <= 65536:
        rows *= 2
    return min(rows, dataset.shape[0])


def as_without_subtrees(name, dataset):
    """What counts of an array in a file with subtrees; None: nothing."""
    values = high_water(dataset) if name == "/mesh/faces" else dataset[...]
    if name == "/mesh/faces_index":
        return values[::2] if len(values) > 2 else None
    if name in ("/mesh/vertices", "/border/points") or name.startswith("/maps/"):
        code, full = values.dtype, full_rows(dataset)
        plain = delta(dataset)
        for row in range(dataset.chunks[0], len(values), dataset.chunks[0]):
            if row % full:
                step = plain[row] - plain[row - 1]
                values[row] = ((step << 1) ^ (step >> (8 * code.itemsize - 1))).astype(code)
    return values


def checksum_of(file, path):
    """The attribute that counts an array."""
    border = path.startswith("/border/") or (text(file.attrs["kind"]) == "surface" and path.endswith("_winding"))
    if path.startswith("/surface/"):
        return "surface_sha256"
    return "border_sha256" if border else "colours_sha256" if path.endswith("/gray_colours") else "content_sha256"


def content_sha256(file, attribute="content_sha256"):
    """checksums.md, section 1; colours.md; border.md."""
    total, subtrees = hashlib.sha256(), "subtrees" in parts_of(file)
    for name, dataset in sorted(arrays(file).items()):
        if name.startswith("/subtrees/") or checksum_of(file, name) != attribute:
            continue
        plain = high_water if name == "/mesh/faces" else np.asarray
        values = as_without_subtrees(name, dataset) if subtrees else plain(dataset)
        if values is not None:
            total.update(name.encode() + b"\0" + hashlib.sha256(values.tobytes()).digest())
    return total.hexdigest()


def check_subtrees(file):
    """subtrees.md: the table adds up to what the tree has, and the list to the file."""
    counts, index = (file[f"/subtrees/{name}"] for name in ("counts", "index"))
    rows, sums = counts.chunks[0], np.cumsum(counts[...].astype("u8"), axis=0)
    assert (index[1:] == sums[rows - 1:(len(index) - 1) * rows:rows]).all() and not index[0].any()
    root, levels = one(file.attrs["subtree_level"]), one(file.attrs["level_count"])
    subtree, own, column = np.arange(len(counts)), 0, 6
    firsts, refs = np.full(len(counts), -1), [np.zeros(0, "i8") for _ in range(len(counts))]
    for number in range(root + 1, levels):
        level = level_arrays(file, number)
        types = (level["types"][...][:, None] >> (2 * np.arange(8, dtype="u2"))) & 3
        of = np.repeat(subtree, 8).reshape(-1, 8)

        def total(name, owners, level=level):
            values = level[name][...] if name in level else np.zeros(len(owners))
            return np.bincount(owners, values, len(counts))

        gray, leaf = of[types == 3], of[types == 2]
        ends = np.zeros(len(counts), "u8")
        if "leaf_skip" in level:
            first = leaf_first(level)
            np.maximum.at(ends, leaf, first + level["leaf_new"][...])
            listed, owners = leaf_refs(level, first), np.repeat(leaf, level["leaf_ref_count"][...].astype("i8"))
            for i in np.unique(leaf):
                least = first[leaf == i].min()
                firsts[i] = least if firsts[i] < 0 else min(firsts[i], least)
            for i in np.unique(owners):
                refs[i] = np.concatenate([refs[i], listed[owners == i]])
        ends = np.maximum.accumulate(ends)
        own = own + total("leaf_new", leaf)
        expected = [np.bincount(of[types == k], minlength=len(counts)) for k in (3, 2, 1)]
        expected += [total("plane_counts", gray), total("leaf_plane_counts", leaf),
                     total("leaf_ref_count", leaf), np.diff(ends, prepend=np.uint64(0))]
        assert (np.transpose(expected) == counts[:, column:column + 7]).all(), f"level {number}"
        subtree, column = gray, column + 7
    assert (counts[:, 1] == own).all(), "new faces"
    check_faces_of_subtrees(file, counts[...].astype("u8"), sums, firsts, refs)
    check_places(file)


def distances(numbers, rows, at):
    """From the block of `at` back to the blocks of some faces or vertices, ascending, each once."""
    return sorted((at // rows - np.unique(numbers // rows)).tolist())


def check_faces_of_subtrees(file, counts, sums, firsts, refs):
    """Where a subtree's faces and vertices begin, and the blocks from elsewhere that it needs.
    `firsts`: the least leaf_first of its leaves, -1 without any; `refs`: what these refer to."""
    if "mesh" not in parts_of(file):
        return
    corners = faces(file["/mesh/faces"]).reshape(-1, 3).astype("i8")
    before = (sums - counts).astype("i8")
    outer = file["/subtrees/shared_chunks"][...] if "shared_chunks" in file["/subtrees"] else np.zeros(0, "u4")
    for i, row in enumerate(counts.astype("i8")):
        first, vertex = (before[i, k] + before[i, k + 1] + row[k] for k in (0, 2))
        own, older = corners[first:first + row[1]], refs[i][refs[i] < first]
        seen = corners[:first].max(initial=-1) + 1
        assert firsts[i] in (-1, first), f"subtree {i}: first face"
        assert vertex == seen and row[3] == max(own.max(initial=-1) + 1, seen) - seen, f"subtree {i}: vertices"
        used = np.concatenate([own.ravel(), corners[older].ravel()])
        blocks = distances(older, 2048, first), distances(used[used < vertex], 1024, vertex)
        begin = before[i, 4] + before[i, 5]
        assert (len(blocks[0]), len(blocks[1])) == (row[4], row[5]), f"subtree {i}: blocks"
        assert outer[begin:begin + row[4] + row[5]].tolist() == blocks[0] + blocks[1], f"subtree {i}: blocks"


LEVEL_NAMES = ["types", "plane_counts", "planes", "leaf_winding", "black_winding", "white_winding",
               "leaf_skip", "leaf_new", "leaf_ref_count", "leaf_refs", "types_index", "gray_index",
               "leaf_index", "leaf_plane_counts", "leaf_planes", "gray_colours"]
ROOT_PATHS = {4096: "/mesh/vertices", 4097: "/mesh/faces", 4098: "/mesh/faces_index",
              4099: "/maps/vertex_source", 4100: "/maps/face_source", 4101: "/border/loops", 4102: "/border/points",
              4103: "/surface/patches", 4104: "/surface/triangles", 4105: "/surface/points", 4106: "/surface/normals",
              4107: "/surface/colours",
              4112: "/subtrees/index",
              4113: "/subtrees/counts", 4114: "/subtrees/shared_chunks", 4117: "/subtrees/checksums"}


def path_of(number):
    """subtrees.md, section 3: the array that a number stands for; None: a gap, or not one of sections 6 and 9, or of annex C."""
    level, name = divmod(number, 64)
    if level < 64:
        return f"/levels/{level:02d}/{LEVEL_NAMES[name]}" if name < len(LEVEL_NAMES) else None
    return ROOT_PATHS.get(number)


def holds(file, path):
    """Whether a list about all chunks is true: other programs that write the file anew leave it as it was."""
    stated = {k: one(v) for k, v in file[path].attrs.items() if k in ("file_bytes", "offset")}
    if stated.get("file_bytes") != pathlib.Path(file.filename).stat().st_size:
        return False
    return stated.get("offset") == file[path].id.get_chunk_info(0).byte_offset


def literals_bytes(block):
    """How many bytes the literals of a zstd block take. RFC 8878, section 3.1.1.3.1."""
    kind, form = block[0] & 3, block[0] >> 2 & 3
    header = ((1, 2, 1, 3) if kind < 2 else (3, 3, 4, 5))[form]
    bits = int.from_bytes(block[:header], "little")
    if kind < 2:
        return header + (1 if kind else bits >> (3 if header == 1 else 4))
    width = (10, 10, 14, 18)[form]
    return header + (bits >> 4 + width) % 2**width


def check_frame(frame, path):
    """A zstd frame states its size, has a checksum, and nothing in it that decoders do not look at."""
    descriptor = frame[4]
    single, size_code = descriptor >> 5 & 1, descriptor >> 6
    assert descriptor & 4 and (single or size_code), f"{path}: a frame without its checksum or size"
    assert not descriptor & 16, f"{path}: an unused bit of a frame is set"
    at, last = 5 + (not single) + (0, 1, 2, 4)[descriptor & 3] + (1 << size_code if size_code else 1), False
    while not last:
        header = int.from_bytes(frame[at:at + 3], "little")
        last, kind, size = header & 1, header >> 1 & 3, header >> 3
        assert not (kind == 1 and size == 1), f"{path}: a block repeats its byte once"
        block = frame[at + 3:at + 3 + (1 if kind == 1 else size)]
        if kind == 2:
            sequences = block[literals_bytes(block):]
            modes = 1 if sequences[0] < 128 else 2 if sequences[0] < 255 else 3
            assert sequences[0] == 0 or not sequences[modes] & 3, f"{path}: an unused bit of a frame is set"
        at += 3 + len(block)
    assert at + 4 == len(frame), f"{path}: the frame does not fill the chunk"


def check_frames(file):
    """README.md, section 4: the frames of a file whose pipeline is zstd."""
    for path, dataset in arrays(file).items():
        pipeline = dataset.id.get_create_plist()
        if any(pipeline.get_filter(i)[0] == 32015 for i in range(pipeline.get_nfilters())):
            for i in range(dataset.id.get_num_chunks()):
                check_frame(dataset.id.read_direct_chunk(dataset.id.get_chunk_info(i).chunk_offset)[1], path)


def checksum_list(file):
    """checksums.md, sections 3 and 4: the list of checksums that is not to be ignored, if any."""
    for path in "/subtrees/checksum_index", "/chunk_checksums":
        if path == "/subtrees/checksum_index" and "subtrees" not in parts_of(file):
            continue
        if path in file and holds(file, path) and file[path].id.get_create_plist().get_nfilters():  # bare: no checksums
            return path
    return None


def paged_arrays(file):
    """checksums.md, section 4: {number: array}, of those whose chunks are in /subtrees/checksums."""
    if checksum_list(file) != "/subtrees/checksum_index":
        return {}
    blocks, deep = len(file["/subtrees/index"]), 64 * (one(file.attrs["subtree_level"]) + 1)
    numbers = [n for n in range(deep, 4096) if n % 64 not in (10, 11, 12)] + [4096, 4097, 4099, 4100]
    called = arrays(file)
    return {n: called[path_of(n)] for n in numbers
            if path_of(n) in called and called[path_of(n)].id.get_num_chunks() > blocks}


def rows_before(file, number, block):
    """The rows of a paged array before the subtrees of a chunk of /subtrees/counts."""
    row = [int(v) for v in file["/subtrees/index"][block]]
    if number >= 4096:
        return row[0] + row[1] if number in (4097, 4100) else row[2] + row[3]
    k = number // 64 - one(file.attrs["subtree_level"]) - 1
    gray, leaf, black, planes, leaf_planes, refs = row[6 + 7 * k:12 + 7 * k]
    groups = row[6 + 7 * (k - 1)] if k else block * file["/subtrees/counts"].chunks[0]
    return {"types": groups, "plane_counts": gray, "gray_colours": gray, "planes": planes, "black_winding": black,
            "white_winding": 8 * groups - gray - leaf - black, "leaf_refs": refs,
            "leaf_planes": leaf_planes}.get(LEVEL_NAMES[number % 64], leaf)


def paged_order(file):
    """checksums.md, section 4: (number, chunk) of each row of /subtrees/checksums."""
    paged = paged_arrays(file)
    done, blocks = dict.fromkeys(paged, 0), len(file["/subtrees/index"])
    for block in range(blocks):
        for number, array in paged.items():
            while done[number] < array.id.get_num_chunks() and (
                    block + 1 == blocks or done[number] * array.chunks[0] < rows_before(file, number, block + 1)):
                yield number, done[number]
                done[number] += 1


def check_sums(file):
    """checksums.md, sections 3 and 4: each chunk of the arrays that the head calls for ends as the list says."""
    path_of_list = checksum_list(file)
    if not path_of_list:
        return
    numbers, sums = np.divmod(file[path_of_list][...], np.uint64(1 << 32))
    assert (numbers[:-1] <= numbers[1:]).all(), "checksums: not in order"
    stored, ends = pathlib.Path(file.filename).read_bytes(), {}
    for path, dataset in arrays(file).items():
        chunks = [dataset.id.get_chunk_info(i) for i in range(dataset.id.get_num_chunks())]
        ends[path] = [int.from_bytes(stored[c.byte_offset:c.byte_offset + c.size][-4:], "little") for c in chunks]
    paged = paged_arrays(file)
    of_list = {path_of(int(number)): int(number) for number in np.unique(numbers)}
    for path in ends.keys() - {path_of(number) for number in paged} - {"/subtrees/chunk_directory"}:
        assert ends[path] == sums[numbers == of_list[path]].tolist(), f"{path}: another chunk's bytes"
    if paged:
        expected = [ends[path_of(number)][chunk] for number, chunk in paged_order(file)]
        assert expected == file["/subtrees/checksums"][...].tolist(), "/subtrees/checksums: another chunk's bytes"


def check_places(file):
    """The list of chunks leads to where HDF5 says that they are; it is ignored where its attributes are not true."""
    if not holds(file, "/subtrees/chunk_directory"):
        return
    places, seen, arrays_of_file = file["/subtrees/chunk_directory"], {}, arrays(file)
    at = file["/levels/00/types"].id.get_chunk_info(0).byte_offset
    for place in places[...]:
        number, size = divmod(int(place), 1 << 32)
        path = path_of(number)
        if path in arrays_of_file:
            chunk = file[path].id.get_chunk_info(seen.setdefault(path, 0))
            assert (chunk.byte_offset, chunk.size) == (at, size), f"{path}: chunk {seen[path]}"
            seen[path] += 1
        at += int(size)
    assert all(count == file[path].id.get_num_chunks() for path, count in seen.items())


def attribute_values(dataset, kind):
    """attributes.md: rows of values, by the array's coding. `kind`: a type of numpy."""
    code, word = dataset.dtype, text(dataset.attrs["coding"])
    assert word in ("plain", "column-delta") and code.itemsize == np.dtype(kind).itemsize, dataset.name
    if word == "plain":
        return dataset[...].view(kind)
    parts = []
    for part in in_chunks(dataset):
        columns = part.reshape(-1).reshape(part.size // len(part), len(part))
        ordered = np.cumsum(unzigzag(columns), axis=1, dtype=unzigzag(columns).dtype)
        if np.dtype(kind).kind == "f":
            ordered = np.where(ordered < 0, ordered ^ np.iinfo(ordered.dtype).max, ordered)
        parts.append(np.ascontiguousarray(ordered.T).reshape(part.shape))
    return np.concatenate(parts).view(kind)


ATTRIBUTE_TYPES = {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
                   "float32": "f4", "float64": "f8"}


def read_attributes(file):
    """attributes.md: the part as vectors' .attributes.json have it, if its checksum is right."""
    group, digests, out, images = file["/attributes"], {}, [], {}

    def digest(path, values):
        digests[path] = hashlib.sha256(np.ascontiguousarray(values).tobytes()).digest()
        return values

    for number in range(int(group.attrs["arrays"])):
        path = f"/attributes/{number:03d}"
        array, kind = file[path], ATTRIBUTE_TYPES[text(file[path].attrs["type"])]
        one = {name: text(array.attrs[name]) for name in ("element", "columns", "type")}
        one["list"] = text(array.attrs["list"]) if "list" in array.attrs else None
        assert one["list"] is None or one["list"] in list(ATTRIBUTE_TYPES)[:6]
        different = one["list"] is not None and array.attrs["lengths_differ"] == 1
        values = digest(path, attribute_values(array, "u8" if different else kind))
        one["rows"], one["ends"] = len(values), listed(values) if different else None
        if different:
            ends = values.astype("i8")
            assert (np.diff(ends, prepend=0) >= 0).all(), f"{path}: ends"
            items = f"{path}_items"
            values = digest(items, attribute_values(file[items], kind)) if items in file else np.zeros(0, kind)
            assert ends[-1] == len(values), f"{path}: items"
        assert one["element"] not in ("vertex", "face") or one["rows"] == file.attrs[one["element"] + "_count"], path
        if one["element"] == "ebpo:texture" and different:
            images[one["columns"]] = [part.tobytes() for part in np.split(values, ends[:-1])]
        columns = len(one["columns"].split(" "))
        assert values.ndim == 1 or columns == values.shape[1] or one["list"] is not None, path
        bits = values.view("u%d" % values.dtype.itemsize)
        one["bits"] = listed(bits)                       # of floats: as integers, as NaN is none of JSON's numbers
        out.append(one)
    header = digest("/attributes/header", file["/attributes/header"][...]) if "header" in group else None
    total = hashlib.sha256()
    for path in sorted(digests):
        total.update(path.encode() + b"\0" + digests[path])
    assert total.hexdigest() == text(group.attrs["sha256"]), "attributes: sha256 differs"
    for image, sha256 in zip(images.get("bytes", []), images.get("sha256", [])):
        assert not image or hashlib.sha256(image).digest() == sha256, "attributes: an image's sha256 differs"
    return {"header": None if header is None else header.tobytes().decode("latin-1"), "arrays": out}


def colours_of(file, element):
    """attributes.md, section 4: red, green and blue of vertices or faces as bytes; None: they have none."""
    found = {}
    for number in range(int(file["/attributes"].attrs["arrays"])):
        array = file[f"/attributes/{number:03d}"]
        if text(array.attrs["element"]) == element and "list" not in array.attrs:
            kind = text(array.attrs["type"])
            values = attribute_values(array, ATTRIBUTE_TYPES[kind]).reshape(len(array), -1)
            for column, name in enumerate(text(array.attrs["columns"]).split(" ")):
                full = {"uint16": 65535, "float32": 1, "float64": 1}.get(kind, 255)
                found.setdefault(name, values[:, column].astype("f8") / full * 255)
    for names in (["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"]):
        if all(name in found for name in names):
            scaled = np.stack([found[name] for name in names], axis=1)
            return np.where(scaled >= 255, 255, np.where(scaled > 0, scaled + 0.5, 0)).astype("i8")
    return None


def face_sums(file):
    """colours.md: of each face weight times thrice the colour, and thrice the weight; None: no colours."""
    of_vertex, of_face = colours_of(file, "vertex"), colours_of(file, "face")
    if of_vertex is None and of_face is None:
        return None
    at, corners = vertices(file["/mesh/vertices"]).astype("f8").reshape(-1, 3), faces(file["/mesh/faces"]).reshape(-1, 3)
    by_face = of_face is not None and (of_vertex is None or (of_vertex == of_vertex[0]).all())
    thrice = 3 * of_face if by_face else of_vertex[corners].sum(axis=1)
    size = np.asarray(file.attrs["box_size"]).max()
    u, v = (at[corners[:, 1]] - at[corners[:, 0]]) / size, (at[corners[:, 2]] - at[corners[:, 0]]) / size
    x = u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]
    y = u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]
    z = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    weight = 1 + (np.sqrt(x * x + y * y + z * z) * 2**32).astype("i8")
    return np.concatenate([weight[:, None] * thrice, 3 * weight[:, None]], 1).astype(object)


def leaf_sums(level, of_faces):
    """The same of each leaf, over all faces that it lists."""
    first, before = leaf_first(level).astype("i8"), np.zeros((len(of_faces) + 1, 4), object)
    before[1:] = np.cumsum(of_faces, axis=0)
    out = before[first + level["leaf_new"][...].astype("i8")] - before[first]
    if "leaf_refs" in level:
        leaf = np.repeat(np.arange(len(first)), level["leaf_ref_count"][...].astype("i8"))
        np.add.at(out, leaf, of_faces[leaf_refs(level, first)])
    return out


def check_colours(file):
    """Colours of gray nodes, where the file has what they are of."""
    parts = parts_of(file)
    of_faces = face_sums(file) if {"colours", "mesh", "attributes"} <= set(parts) and "pruned" not in parts else None
    below = None
    for number in reversed(range(one(file.attrs["level_count"]) if of_faces is not None else 0)):
        level = level_arrays(file, number)
        kinds = level["types"][...][:, None] >> 2 * np.arange(8 if number else 1) & 3
        sums = np.zeros(kinds.shape + (4,), object)
        if (kinds == 2).any():
            sums[kinds == 2] = leaf_sums(level, of_faces)
        if (kinds == 3).any():
            sums[kinds == 3] = below
            channel = [(2 * below[:, k] + below[:, 3]) // (2 * below[:, 3]) for k in range(3)]
            assert (level["gray_colours"][...] == channel[0] + 256 * channel[1] + 65536 * channel[2]).all(), f"level {number}: colours"
        below = sums.sum(axis=1)


def listed(values):
    if values is None:
        return None
    values = np.asarray(values)
    if values.size > 1000:
        return "sha256 " + hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
    return values.ravel().tolist()


def one(value):
    """A number or a text: a scalar, or a row of one."""
    value = np.asarray(value).reshape(-1)[0]
    return value.item() if hasattr(value, "item") else value


def text(value):
    """Up to its first zero byte, however it is padded."""
    value = one(value)
    return (value if isinstance(value, bytes) else str(value).encode()).split(b"\0")[0].decode()


def parts_of(file):
    return text(file.attrs["required_parts"]).split() + text(file.attrs["optional_parts"]).split()


def read_level(file, number, parts):
    level, attrs = level_arrays(file, number), file[f"/levels/{number:02d}"].attrs

    def plain(name, dtype):
        return listed(level[name][...].astype(dtype)) if name in level else None

    out = {"level": number, "gray_volume": one(attrs["gray_volume"]), "leaf_volume": one(attrs["leaf_volume"])}
    out["types"] = plain("types", "u2")
    out["plane_counts"] = plain("plane_counts", "u1")
    out["planes"] = plain("planes", "u4")
    for name in ("leaf_winding", "black_winding", "white_winding"):
        out[name] = plain(name, "i4")
    first = leaf_first(level) if "leaf_skip" in level else None
    out["leaf_first"] = listed(first)
    out["leaf_new"] = plain("leaf_new", "u4")
    out["leaf_ref_count"] = plain("leaf_ref_count", "u4")
    out["leaf_refs"] = listed(leaf_refs(level, first)) if "leaf_refs" in level else None
    out["leaf_plane_counts"] = plain("leaf_plane_counts", "u1")
    out["leaf_planes"] = plain("leaf_planes", "u4")
    if "gray_colours" in level:
        out["gray_colours"] = plain("gray_colours", "u4")
        assert level["gray_colours"][...].max() < 1 << 24, f"level {number}: a colour"
    return out


def check_border(file):
    """border.md: the loops, and in a whole file that they are the border."""
    attrs, parts = file.attrs, parts_of(file)
    assert "mesh" in parts and text(attrs["kind"]) == "surface", "a border without mesh, or of a solid"
    loops, count = one(attrs["border_loops"]), one(attrs["border_points"])
    assert 3 * loops <= count < 1 << 31, "counts of the border"
    rows = file["/border/loops"][...].astype("i8") if loops else np.zeros((0, 2), "i8")
    points = vertices(file["/border/points"]).astype("f8") + 0.0 if loops else np.zeros((0, 3))
    assert (rows[:, 0] >= 3).all() and (rows[:, 1] >= 1).all(), "a loop"
    assert sum(n * weight for n, weight in rows.tolist()) <= 1 << 28, "weights"
    assert rows[:, 0].sum() == count and rows[:, 0].max(initial=0) == one(attrs["border_longest"]), "loops and counts"
    assert np.isfinite(points).all(), "a coordinate"
    if "pruned" in parts:
        return
    chain = {}

    def add(a, b, weight):
        chain[a, b] = chain.get((a, b), 0) + weight
        chain[b, a] = chain.get((b, a), 0) - weight

    corners = vertices(file["/mesh/vertices"]).astype("f8")[faces(file["/mesh/faces"])].reshape(-1, 3, 3) + 0.0
    for face in corners.tolist():
        for k in range(3):
            add(tuple(face[k]), tuple(face[(k + 1) % 3]), 1)
    for (n, weight), end in zip(rows.tolist(), np.cumsum(rows[:, 0]).tolist()):
        loop = [tuple(p) for p in points[end - n:end].tolist()]
        for a, b in zip(loop, loop[1:] + loop[:1]):
            add(a, b, -weight)
    assert not any(chain.values()), "the loops are not the border"


def patch_triangles(code, count, vertices):
    """surface.md, section 3: the triangles, and (a, b, beyond) of each vertex that became new at an edge, else None."""
    edges, begins, origin, out, at, end = [], {}, [], [], 0, len(code)

    def number():
        nonlocal end
        value = 0
        for k in range(4):
            end -= 1
            assert at <= end, "a number of a patch"
            value |= (code[end] & 127) << 7 * k
            if code[end] < 128:
                return value
        raise AssertionError("a number of a patch")

    def new(of):
        assert len(origin) < vertices, "vertices of a patch"
        origin.append(of)
        return len(origin) - 1

    def add(a, b, beyond):
        edges.append({"from": a, "to": b, "beyond": beyond, "left": None, "right": None, "open": True})
        begins[a] = edges[-1]
        return edges[-1]

    def join(p, q):
        if p:
            p["right"] = q
        if q:
            q["left"] = p

    while len(out) < count:
        while edges and not edges[-1]["open"]:
            edges.pop()
        if not edges:
            corners = []
            for _ in range(3):
                back = number()
                assert back <= len(origin), "a vertex of a patch"
                corners.append(len(origin) - back if back else new(None))
            a, b, c = corners
            ring = [add(b, a, c), add(a, c, b), add(c, b, a)] if len({a, b, c}) == 3 else []
            for k in range(len(ring)):
                join(ring[k - 1], ring[k])
            out.append((a, b, c))
            continue
        assert at < end, "bytes of a patch"
        edge, byte = edges.pop(), code[at]
        edge["open"] = False
        a, b, l, r = edge["from"], edge["to"], edge["left"], edge["right"]
        at += 1
        if byte == 3:
            join(l, None)
            join(None, r)
            continue
        assert byte < 5 and (byte != 1 or l) and (byte != 2 or r), "a byte of a patch"
        c = new((a, b, edge["beyond"])) if byte == 0 else l["from"] if byte == 1 else r["to"] if byte == 2 else \
            len(origin) - 1 - number()
        assert c >= 0 and c not in (a, b), "a vertex of a patch"
        out.append((a, b, c))
        before = begins.get(c)
        of_l, of_r = bool(l) and l["from"] == c, bool(r) and r["to"] == c
        if of_l:
            l["open"], l = False, l["left"]
        if of_r:
            r["open"], r = False, r["right"]
        if of_l and of_r:
            join(l, r)
            continue
        first = None if of_l else add(a, c, b)
        last = None if of_r else add(c, b, a)
        join(l, first or last)
        join(last or first, r)
        if first and last:
            known = before if before and before["open"] else None
            left = known["left"] if known else first
            join(first, known or last)
            join(left, last)
    assert at == end, "bytes of a patch"
    return out, origin + [None] * (vertices - len(origin))


def patch_point(points, v, step, of):
    """surface.md, section 4: the coordinates of vertex v of a patch, from those before it."""
    a, b, c = points[list(of)].tolist() if of else 3 * [points[v - 1].tolist() if v else [0, 0, 0]]
    guess = [(7 * (p + q) - 6 * r + 4) // 8 for p, q, r in zip(a, b, c)]
    p, q = [x - r for x, r in zip(a, c)], [x - r for x, r in zip(b, c)]
    n = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
    k = max(range(3), key=lambda i: abs(n[i]))
    out = [(x + d + 32768) % 65536 - 32768 for x, d in zip(guess, step)]
    if n[k]:
        rise = sum(n[i] * (out[i] - guess[i]) for i in range(3) if i != k)
        out[k] = (guess[k] - (2 * rise + n[k]) // (2 * n[k]) + step[k] + 32768) % 65536 - 32768
    return out


def check_surface(file):
    """surface.md: the table, and the codes; returns triangles and points of all patches."""
    count = {name: one(file.attrs[f"surface_{name}"]) for name in
             ("patches", "triangles", "vertices", "code_bytes", "colours")}
    assert 1 <= count["patches"] <= count["triangles"] <= count["code_bytes"] <= 1 << 40, "counts of the surface"
    assert 3 <= count["vertices"] <= 1 << 40 and count["colours"] in (0, count["vertices"]), "counts of the surface"
    rows = file["/surface/patches"][...].tolist()
    names = ["patches", "triangles", "points", "normals"] + ["colours"] * (count["colours"] > 0)
    lengths = [count[name] for name in ("patches", "code_bytes", "vertices", "vertices", "colours")]
    assert [len(file[f"/surface/{name}"]) for name in names] == lengths[:len(names)], "arrays of the surface"
    codes, steps = bytes(file["/surface/triangles"][...]), file["/surface/points"][...].astype("i8")
    octcodes = [row[0] for row in rows]
    assert all(a < b for a, b in zip(octcodes, octcodes[1:])), "octcodes of patches"
    levels = [code.bit_length() // 3 for code in octcodes]
    assert all(code and code.bit_length() % 3 == 1 for code in octcodes), "an octcode of a patch"
    assert max(levels) < min(one(file.attrs["level_count"]), 15), "levels of patches"
    most = 2 ** 32 - 1 if "pruned" in parts_of(file) else one(file.attrs["face_count"])
    sums, out = [0, 0, 0], []
    for _, first, faces_of, triangles, corners, size, error in rows:
        assert 1 <= faces_of and first + faces_of <= most, "faces of a patch"
        assert 1 <= triangles <= min(faces_of, size) and 3 <= corners <= 3 * faces_of, "counts of a patch"
        assert error <= 1 << 34, "error of a patch"
        code, rest = codes[sums[2]:sums[2] + size], steps[sums[1]:sums[1] + corners]
        assert (len(code), len(rest)) == (size, corners), "counts of patches"
        listed_triangles, origin = patch_triangles(code, triangles, corners)
        points = np.zeros((corners, 3), "i8")
        for v, (step, of) in enumerate(zip((rest >> 1) ^ -(rest & 1), origin)):
            points[v] = patch_point(points, v, step.tolist(), of)
        out.append((listed_triangles, points))
        sums = [sums[0] + triangles, sums[1] + corners, sums[2] + size]
    assert sums == [count["triangles"], count["vertices"], count["code_bytes"]], "patches and counts"
    return out


def check_pruned(file, subset):
    """Subsets: an empty group for each pruned node, and on the last level all gray nodes pruned."""
    count = one(file.attrs["level_count"])
    levels = [file[f"/levels/{number:02d}"] for number in range(count)]
    for number, level in enumerate(levels):
        gray, pruned = one(level.attrs["gray"]), one(level.attrs.get("pruned", 0))
        empty = gray if number + 1 == count else int((levels[number + 1]["types"][...] == 0).sum())
        assert not subset or pruned == empty, f"level {number}: {pruned} pruned nodes, {empty} empty groups"
        assert subset or (pruned == 0 and (gray == 0) == (number + 1 == count)), f"level {number}: pruned nodes in a file that is no subset"


def plane_of(code):
    """README.md, section 8: the half-space n . xi <= d / 4096 of a code."""
    u, v, q = (code & 1023) - 511, (code >> 10 & 1023) - 511, code >> 20
    n = [u, v, 511 - abs(u) - abs(v)]
    if n[2] < 0:
        n[:2] = [(1 if u >= 0 else -1) * (511 - abs(v)), (1 if v >= 0 else -1) * (511 - abs(u))]
    return n, 4096 * sum(min(i, 0) for i in n) + 511 * (q + 1)


def half_space(code, corner, size):
    n, d = plane_of(code)
    world = [a / s for a, s in zip(n, size)]
    return {"code": code, "n": n, "d": d, "model": world + [d / 4096 + sum(a * c for a, c in zip(world, corner))]}


def nodes(file):
    """All nodes breadth first: octcode, type, rank, cell, the half-spaces that are its own."""
    out, parents = [], []
    origin, size = file.attrs["box_origin"], file.attrs["box_size"]
    for number in range(one(file.attrs["level_count"])):
        level = level_arrays(file, number)
        rank, grays, at = [0] * 4, [], {"": 0, "leaf_": 0}
        lists = {part: [level[part + name][...] if part + name in level else None for name in ("plane_counts", "planes")]
                 for part in ("", "leaf_")}
        for group, types in enumerate(level["types"][...]):
            for octant in range(8 if number else 1):
                kind = int(types) >> 2 * octant & 3
                code, mine = parents[group] << 3 | octant if number else 1, rank[kind]
                rank[kind] += 1
                if number and types == 0:
                    continue  # a place below a pruned node
                place = [sum((code >> 3 * k + axis & 1) << k for k in range(number)) for axis in range(3)]
                edge = [s / 2 ** number for s in size]
                corner, planes = [o + p * e for o, p, e in zip(origin, place, edge)], []
                part = {2: "leaf_", 3: ""}.get(kind)
                if part is not None and lists[part][0] is not None:
                    count = int(lists[part][0][mine])
                    planes = [int(c) for c in lists[part][1][at[part]:at[part] + count]] if count else []
                    at[part] += count
                if kind == 3:
                    grays.append(code)
                out.append({"octcode": code, "type": ("white", "black", "leaf", "gray")[kind], "rank": mine, "corner": corner,
                            "size": edge, "half_spaces": [half_space(c, corner, edge) for c in planes]})
        parents = grays
    return out


def winding(corners, point):
    """By the solid angles of all faces (van Oosterom and Strackee), of a point that is on none."""
    a, b, c = (corners[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return round(np.arctan2(above, below).sum() / (2 * np.pi))


def check_point(file, expected):
    xyz = vertices(file["/mesh/vertices"]).astype("f8")
    corners, point = xyz[faces(file["/mesh/faces"])].reshape(-1, 3, 3), np.array(expected["point"])
    if (xyz == point).all(1).any():
        return expected["where"] == "on"
    number = winding(corners, point)
    inside = {"nonzero": number != 0, "evenodd": number % 2 != 0, "positive": number > 0}[text(file.attrs["winding_rule"])]
    return (expected["where"], expected["winding"]) == ("in" if inside else "out", number)


def near(a, b):
    """Equal; numbers that were rounded, but for rounding."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(near(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(near(x, y) for x, y in zip(a, b))
    return abs(a - b) <= 1e-12 * max(abs(a), abs(b), 1) if isinstance(a, float) else a == b


def plain_value(value):
    if np.asarray(value).size > 1:
        return value.tolist()
    return text(value) if isinstance(one(value), (bytes, str)) else one(value)


def check_nodes(path, expected):
    """What a .nodes.json says."""
    with h5py.File(path, "r") as file:
        attributes = {name: plain_value(value) for name, value in file.attrs.items()}
        assert attributes == expected["attributes"], "attributes"
        assert near(nodes(file), expected["nodes"]), "nodes"
        assert all(check_point(file, point) for point in expected.get("points", [])), "points"


def check_vectors(folder):
    for path in sorted(pathlib.Path(folder).glob("*.ebpo.h5")):
        stem = str(path)[:-len(".ebpo.h5")]
        found, wanted = read(path), json.loads(pathlib.Path(stem + ".json").read_text())
        assert same(found, wanted, found["coordinate_type"] == "float32"), path.name
        with h5py.File(path, "r") as file:
            if "attributes" in text(file.attrs["optional_parts"]).split():
                wanted = json.loads(pathlib.Path(stem + ".attributes.json").read_text())
                assert read_attributes(file) == wanted, path.name
        if pathlib.Path(stem + ".nodes.json").exists():
            check_nodes(path, json.loads(pathlib.Path(stem + ".nodes.json").read_text()))
        print(path.name)


def check_weld(file):
    """The record of welding within a distance, in files that have it."""
    if "mend_weld_distance" in file.attrs:
        distance, moved, _ = (one(file.attrs[name]) for name in
                              ("mend_weld_distance", "mend_weld_moved", "mend_collapsed_faces"))
        assert 0 < distance < float("inf"), "mend_weld_distance is not finite and above 0"
        assert one(file.attrs["mend_weld"]) == 1, "mend_weld is 0 beside mend_weld_distance"
        assert 0 <= moved < float("inf"), "mend_weld_moved is negative or not finite"


def read(path):
    with h5py.File(path, "r") as file:
        assert text(file.attrs["format"]) == "EBP-Octree in HDF5" and one(file.attrs["format_version_major"]) == 1
        assert text(file.attrs.get("format_version", "")) != "1.0-draft"
        required = text(file.attrs["required_parts"]).split()
        unknown = set(required) - {"levels", "mesh", "planes", "maps", "leaf-planes", "subtrees", "gates", "inside", "pruned"}
        assert not unknown, f"needs {unknown}"
        parts = set(parts_of(file))
        given, added, dropped = (one(file.attrs.get(name, 0)) for name in
                                 ("source_face_count", "mend_added_faces", "mend_dropped_faces"))
        assert dropped <= given, "more faces were dropped than the source has"
        assert one(file.attrs["face_count"]) <= given + added - dropped, "more faces than the source's"
        check_weld(file)
        check_frames(file)
        assert content_sha256(file) == text(file.attrs["content_sha256"]), "content_sha256 differs"
        for part in {"colours", "border", "surface"} & parts:
            assert content_sha256(file, f"{part}_sha256") == text(file.attrs[f"{part}_sha256"]), f"{part}_sha256 differs"
        check_pruned(file, "pruned" in parts)
        check_codings(file)
        check_sums(file)
        check_colours(file)
        if "border" in parts:
            check_border(file)
        if "surface" in parts:
            check_surface(file)
        if "subtrees" in parts:
            check_subtrees(file)
        out = {name: text(file.attrs[name]) for name in ("kind", "winding_rule", "coordinate_type")}
        out["levels"] = [read_level(file, number, parts) for number in range(one(file.attrs["level_count"]))]
        mesh, maps = "mesh" in parts, "maps" in parts
        out["mesh"] = {
            "level": None,
            "vertices": listed(vertices(file["/mesh/vertices"])) if mesh else None,
            "faces": listed(faces(file["/mesh/faces"])) if mesh else None,
            "vertex_source": listed(delta(file["/maps/vertex_source"]).astype("u4")) if maps else None,
            "face_source": listed(delta(file["/maps/face_source"]).astype("u4")) if maps else None,
        }
        return out


def same(a, b, narrow):
    """Equal values; coordinates of float32 files are compared as float32."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k], narrow) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y, narrow) for x, y in zip(a, b))
    if isinstance(a, float) and narrow:
        return np.float32(a) == np.float32(b)
    return a == b


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--vectors":
        sys.exit(check_vectors(sys.argv[2]))
    if len(sys.argv) not in (2, 3) or sys.argv[1].startswith("-"):
        sys.exit("usage: read_ebpo.py FILE.ebpo.h5 [EXPECTED.json] | --vectors FOLDER")
    found = read(sys.argv[1])
    if len(sys.argv) == 2:
        json.dump(found, sys.stdout, indent=1)
        print()
    else:
        with open(sys.argv[2], encoding="utf-8") as expected:
            wanted = json.load(expected)
        if not same(found, wanted, found["coordinate_type"] == "float32"):
            sys.exit(f"{sys.argv[1]}: differs from {sys.argv[2]}")
