#!/usr/bin/env python3
"""test_layers.py SOURCE NM LIBRARY OBJECTS: checks the layers of modules, without cycles.

lib/layers.txt and tools/layers.txt list the layer of each module. A file uses another file when it
includes its header, or when its object file needs a symbol that the other object file defines (a
handwritten declaration needs no header). X.c, X.h and X.inc count as one file. The rules:
- a file uses only files of its own module and of lower layers, not of siblings;
- verify uses no code that it checks: no file of construct, of the writer or of query;
- files have no cycles, neither within a module nor across modules;
- only lib/hdf5_write includes <hdf5.h>, and only lib/io <curl/curl.h>;
- every symbol of lib that other files can see begins with ebpo_.
LIBRARY is the static library of lib/, OBJECTS the folder of those of tools/."""
import collections
import pathlib
import re
import subprocess
import sys

OWNERS = {"hdf5.h": "hdf5_write", "curl/": "io"}  # who alone includes what
# The judge shares no code with what it judges: not with the builder, the writer (hdf5_write, and the
# files of format that write) or the queries; and it keeps its own vector functions.
INDEPENDENT = {"verify": ("construct/", "hdf5_write/", "query/", "format/write_", "geometry/vec3")}


class Tree:
    """The C files below one folder, and what each uses of which other."""

    def __init__(self, root):
        self.root = root
        self.floors = {}
        for line in (root / "layers.txt").read_text().splitlines():
            if line and not line.startswith("#"):
                floor, module = line.split()
                self.floors[module] = int(floor)
        self.files = [p for m in sorted(root.iterdir()) if m.is_dir() and m.name != "include"
                      for p in sorted(m.rglob("*")) if p.suffix in (".c", ".h", ".inc")]
        # [file][other]: by what
        self.uses = collections.defaultdict(lambda: collections.defaultdict(set))
        self.problems = [f"{root.name}/{module} has no floor in {root.name}/layers.txt"
                         for module in sorted({self.folder(self.name(p))
                                               for p in self.files} - set(self.floors))]

    def name(self, path):
        return str(path.relative_to(self.root).with_suffix(""))

    def folder(self, name):
        """The longest folder of layers.txt that holds the file."""
        parents = [str(p) for p in pathlib.PurePath(name).parents]
        return next((p for p in parents if p in self.floors), parents[0])

    def note(self, user, used, by):
        if user != used:
            self.uses[user][used].add(by)

    def read_includes(self):
        for path in self.files:
            for number, line in enumerate(path.read_text().splitlines(), 1):
                found = re.match(r'\s*#\s*include\s+["<]([^">]+)[">]', line)
                if not found:
                    continue
                header = found.group(1)
                for begin, owner in OWNERS.items():
                    if (self.root.name == "lib" and header.startswith(begin)
                        and not self.name(path).startswith(owner + "/")):
                        self.problems.append(f"{path.relative_to(self.root.parent)}:{number}: "
                                             f"only lib/{owner} includes {header}")
                for target in (self.root / header, path.parent / header):
                    if target in self.files:
                        self.note(self.name(path), self.name(target), f"includes {header}")
                        break

    def read_symbols(self, listing):
        """`listing`: what nm -A says. Objects are named after their sources, by their paths or the
        last part of these."""
        by_object = {}
        for path in self.files:
            if path.suffix == ".c":
                relative = str(path.relative_to(self.root))
                by_object[relative.replace("/", "_")
                          + ".o"] = by_object[path.name + ".o"] = self.name(path)
        defined, wanted = {}, []
        for line in listing.splitlines():
            found = re.match(r"(.*?):\s*(?:[0-9a-fA-F]+)?\s+(\w)\s+(\S+)$", line)
            source = found and by_object.get(re.split(r"[/:\[]", found.group(1).rstrip("]"))[-1])
            if not source:
                continue
            if found.group(2) in "Uwv":
                wanted.append((source, found.group(3)))
            else:
                defined[found.group(3)] = source
                self.check_symbol(source, found.group(3))
        for source, symbol in wanted:
            if symbol in defined:
                self.note(source, defined[symbol], symbol)
        return len(defined)

    def check_symbol(self, source, symbol):
        """Compilers make symbols that begin with an underscore."""
        if self.root.name == "lib" and not symbol.startswith(("ebpo_", "_")):
            self.problems.append(f"lib/{source}: the external symbol {symbol} lacks the prefix ebpo_")

    def check_floors(self):
        for user in sorted(self.uses):
            for used, by in sorted(self.uses[user].items()):
                a, b = self.folder(user), self.folder(used)
                if a != b and self.floors.get(b, 0) >= self.floors.get(a, 0):
                    self.problems.append(f"{self.root.name}/{user} (floor {self.floors.get(a)}) "
                                         f"uses {self.root.name}/{used} "
                                         f"(floor {self.floors.get(b)}): {', '.join(sorted(by))}")

    def check_independence(self):
        for user in sorted(self.uses):
            barred = INDEPENDENT.get(self.folder(user), ())
            for used, by in sorted(self.uses[user].items()):
                if used.startswith(barred):
                    self.problems.append(f"{self.root.name}/{user} uses {self.root.name}/{used}, "
                                         f"but has to be independent of it: {', '.join(sorted(by))}")

    def shortest_circle(self, start):
        """The files of the shortest way from `start` back to itself; [] when there is none."""
        came, queue = {start: None}, collections.deque([start])
        while queue:
            here = queue.popleft()
            for there in sorted(self.uses[here] if here in self.uses else ()):
                if there == start:
                    way = [here]
                    while came[way[-1]] is not None:
                        way.append(came[way[-1]])
                    return way[::-1]
                if there not in came:
                    came[there] = here
                    queue.append(there)
        return []

    def check_circles(self):
        reported = set()
        for start in sorted(self.uses):
            circle = self.shortest_circle(start)
            if not circle or frozenset(circle) in reported:
                continue
            reported.add(frozenset(circle))
            steps = [f"    {a} uses {b}: {', '.join(sorted(self.uses[a][b]))}"
                     for a, b in zip(circle, circle[1:] + circle[:1])]
            self.problems.append("\n".join([f"{self.root.name}: a circle of {len(circle)} files"] + steps))


def main():
    source, nm, library = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    objects = sorted(str(o) for o in pathlib.Path(sys.argv[4]).glob("*.o"))
    problems = []
    for folder, binaries in (("lib", [library]), ("tools", objects)):
        tree = Tree(source / folder)
        tree.read_includes()
        listing = subprocess.run([nm, "-A", "-g", *binaries], capture_output=True, text=True,
                                 check=True).stdout
        if tree.read_symbols(listing) < len(tree.files) / 4:
            tree.problems.append(f"{folder}: {nm} found hardly any symbols in "
                                 f"{', '.join(binaries)[:200]}")
        tree.check_floors()
        if folder == "lib":
            tree.check_independence()
        tree.check_circles()
        problems += tree.problems
    print("\n".join(problems) or "modules use lower floors only, and no files go in a circle")
    return 1 if problems else 0


sys.exit(main())
