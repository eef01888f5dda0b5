#!/usr/bin/env python3
"""json_outputs.py TOOL INPUTS FEATURES SCHEMAS: checks the JSON of every command against its schema.

json.tests lists commands and their schemas. Each command runs over real files, and its output is validated.
A member that the schema does not have is a failure. Every command with --json and every schema must be in
the list. $URL is a web server in the folder. Lines "feature?schema" are omitted when FEATURES (words
separated by commas) does not contain the feature.
"""
import functools
import http.server
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import run as run_tests

HERE = os.path.dirname(os.path.abspath(__file__))
TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
KNOWN = {"$schema", "$id", "$ref", "$defs", "title", "description", "type", "properties", "required",
         "additionalProperties", "items", "enum", "const", "pattern", "minimum", "minItems",
         "maxItems", "anyOf"}


def is_type(value, name):
    if name in ("integer", "number"):
        return (isinstance(value, int if name == "integer" else (int, float))
                and not isinstance(value, bool))
    return isinstance(value, TYPES[name])


class Schemas:
    """The part of JSON Schema that the schemas use; another keyword is an error."""

    def __init__(self, folder):
        self.files = {}
        for name in sorted(os.listdir(folder)):
            if name.endswith(".schema.json"):
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    self.files[name] = json.load(file)

    def resolve(self, ref, at):
        file, _, path = ref.partition("#")
        file = file or at
        schema = self.files[file]
        for part in path.strip("/").split("/") if path.strip("/") else []:
            schema = schema[part]
        return schema, file

    def wrong(self, value, schema, at, where="$"):
        """Returns the violations, one text for each."""
        if set(schema) - KNOWN:
            yield f"{at}: unknown keywords {sorted(set(schema) - KNOWN)}"
        if "$ref" in schema:
            target, file = self.resolve(schema["$ref"], at)
            yield from self.wrong(value, target, file, where)
        if "anyOf" in schema:
            tries = [list(self.wrong(value, s, at, where)) for s in schema["anyOf"]]
            if all(tries):
                yield f"{where}: fits none of {len(tries)}; " + min(tries, key=len)[0]
        types = schema.get("type", [])
        types = [types] if isinstance(types, str) else types
        if types and not any(is_type(value, t) for t in types):
            yield f"{where}: {value!r} is not {' or '.join(types)}"
            return
        if "enum" in schema and value not in schema["enum"]:
            yield f"{where}: {value!r} is not one of {schema['enum']}"
        if "pattern" in schema and isinstance(value, str) and not re.search(schema["pattern"], value):
            yield f"{where}: {value!r} is not {schema['pattern']}"
        if "minimum" in schema and is_type(value, "number") and value < schema["minimum"]:
            yield f"{where}: {value!r} is below {schema['minimum']}"
        if isinstance(value, dict):
            yield from self.wrong_members(value, schema, at, where)
        if isinstance(value, list):
            if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
                yield f"{where}: {len(value)} items"
            for i, item in enumerate(value):
                yield from self.wrong(item, schema.get("items", {}), at, f"{where}[{i}]")

    def wrong_members(self, value, schema, at, where):
        for name in schema.get("required", []):
            if name not in value:
                yield f"{where}: {name} is missing"
        known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
        for name, member in value.items():
            if name in known:
                yield from self.wrong(member, known[name], at, f"{where}.{name}")
            elif others is False:
                yield f"{where}: {name} is not in the schema"
            elif isinstance(others, dict):
                yield from self.wrong(member, others, at, f"{where}.{name}")


def unique(pairs):
    """Builds an object; refuses duplicate names of members."""
    if len({name for name, _ in pairs}) != len(pairs):
        raise ValueError(f"a member is there twice: {[name for name, _ in pairs]}")
    return dict(pairs)


def refuse(word):
    raise ValueError(f"{word} is no JSON")


def documents(form, done):
    text = (done.stderr if form == "stderr" else done.stdout).decode()
    parts = [line for line in text.splitlines() if line] if form == "lines" else [text]
    return [json.loads(part, object_pairs_hook=unique, parse_constant=refuse) for part in parts]


def lines_of(path):
    """Yields (number, feature, schema, command) of each line."""
    for number, line in run_tests.lines_of(path):
        if line:
            name, _, command = line.partition(" | ")
            feature, _, name = name.strip().rpartition("?")
            yield number, feature, name.strip("-"), command


def run(command, folder, environment):
    return subprocess.run(["sh", "-c", command], cwd=folder, env=environment, timeout=300,
                          stdin=subprocess.DEVNULL, capture_output=True)


def check(schemas, name, form, done):
    """Returns the problems of the printed output."""
    try:
        values = documents(form, done)
    except ValueError as error:
        return [str(error)]
    file = name + ".schema.json"
    if file not in schemas.files:
        return [f"there is no {file}"]
    wrong = [] if values else ["nothing was printed"]
    for value in values:
        wrong += schemas.wrong(value, schemas.files[file], file)
        if form != "lines" and next(iter(value)) != "ebpo":
            wrong.append("does not begin with ebpo")
    return wrong


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves the files of a folder, without a log."""

    def log_message(self, *_):
        pass

    def do_GET(self):
        """Serves files; those below /slow are delayed, and served by ranges."""
        requested = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if not self.path.startswith("/slow/") or not requested:
            super().do_GET()
            return
        time.sleep(0.15)
        with open(self.translate_path(self.path[5:]), "rb") as file:
            data = file.read()
        first, last = int(requested[1]), min(int(requested[2]), len(data) - 1)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
        self.send_header("Content-Length", str(last + 1 - first))
        self.end_headers()
        self.wfile.write(data[first:last + 1])


def serve(folder):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0),
                                             functools.partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return server


def commands_with_json(tool):
    reported = subprocess.run([tool, "help"], check=True, capture_output=True, text=True).stdout
    for command in re.findall(r"^  ([a-z]+) ", reported, re.MULTILINE):
        if command != "help" and "  --json" in subprocess.run(
                [tool, command, "--help"], check=True, capture_output=True, text=True).stdout:
            yield command


def self_test(schemas):
    """Checks that the validator detects errors."""
    schema = {"type": "object", "required": ["a"], "additionalProperties": False,
              "properties": {"a": {"type": "integer", "minimum": 0}, "b": {"items": {"enum": [1]}}}}
    for good in ({"a": 1}, {"a": 0, "b": [1, 1]}):
        assert not list(schemas.wrong(good, schema, "")), good
    for bad in ({}, {"a": 1.5}, {"a": True}, {"a": -1}, {"a": 1, "c": 2}, {"a": 1, "b": [1, 2]}, []):
        assert list(schemas.wrong(bad, schema, "")), bad


def main():
    tool, inputs, features, folder_of_schemas = sys.argv[1:]
    schemas = Schemas(folder_of_schemas)
    self_test(schemas)
    environment = dict(os.environ, LC_ALL="C.UTF-8", PATH=os.path.dirname(os.path.abspath(tool)) + ":"
                       + os.environ["PATH"], TESTS=HERE)
    bad, seen, ran, count = [], {"common"}, set(), 0
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([inputs, folder], check=True)
        server = serve(folder)
        environment["URL"] = f"http://127.0.0.1:{server.server_port}"
        for number, feature, name, command in lines_of(os.path.join(HERE, "json.tests")):
            absent = "extras" not in features.split(",") and run_tests.EXTRAS.search(command)
            if run_tests.lacks_terminal(command):
                print(f"skipped: {command} (there is no pseudo-terminal)")
                absent = True
            if absent or feature and feature not in features.split(","):
                seen.add(name.partition(":")[0])
                ran |= set(re.findall(r"ebpo ([a-z]+)", command))
                continue
            done = run(command, folder, environment)
            wrong = [f"exit code {done.returncode}: {done.stderr.decode()}"] if done.returncode else []
            if name and not wrong:
                name, _, form = name.partition(":")
                seen.add(name)
                ran |= set(re.findall(r"ebpo ([a-z]+) (?:\S+ )*?--json", command))
                wrong = check(schemas, name, form, done)
                count += 1
            bad += [f"json.tests:{number}: {command}: {what}" for what in wrong]
        server.shutdown()
    bad += [f"{name} is never printed" for name in {f[:-12] for f in schemas.files} - seen]
    bad += [f"{command} --json is not here" for command in set(commands_with_json(tool)) - ran]
    print("\n".join(bad + [f"{count} outputs, {len(bad)} failed"]))
    return 1 if bad or count < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
