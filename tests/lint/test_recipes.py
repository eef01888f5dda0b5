#!/usr/bin/env python3
"""Checks the recipe of Conda and the formula of Homebrew without either program: test_recipes.py SOURCE_ROOT EBPO

Both are evaluated: the recipe as YAML, once its templates are filled in, the formula in ruby with the words
of Homebrew that it uses (formula.rb), which also runs its test with the command that was built. What they
hand to meson are options that the project has. Shells parse the scripts. Exit code 77: no ruby or no yaml.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys

root, ebpo = map(pathlib.Path, sys.argv[1:3])
packaging = root / "tools/packaging"
problems = []


def check_options(where, words):
    """-Dname=value of the project's own options, or of those that meson has."""
    own = {name: kind for name, kind in re.findall(r"option\('(\w+)', type: '(\w+)'",
                                                   (root / "meson_options.txt").read_text())}
    given = [re.match(r"-D(\w+)=(.*)", word) for word in words if word.startswith("-D")]
    for name, value in (found.groups() for found in given):
        if name not in own:
            problems.append(f"{where}: meson_options.txt has no {name}")
        elif own[name] == "feature" and value not in ("enabled", "disabled", "auto"):
            problems.append(f"{where}: {name} is a feature, not {value}")
    if len(given) < 5:
        problems.append(f"{where}: sets only {len(given)} options")


def check_formula():
    done = subprocess.run(["ruby", "-w", pathlib.Path(__file__).with_name("formula.rb"),
                           packaging / "homebrew/ebpo.rb", ebpo], capture_output=True, text=True)
    if done.returncode:
        problems.append(f"homebrew/ebpo.rb: {done.stderr or done.stdout}")
        return
    said = json.loads(done.stdout.splitlines()[0])
    problems.extend(f"homebrew/ebpo.rb: no {word}" for word in ("desc", "url", "version", "license") if word not in said)
    if len(said["desc"]) > 80:
        problems.append("homebrew/ebpo.rb: desc is longer than 80")
    setup = next((call for call in said["install"] if call[:2] == ["meson", "setup"]), [])
    check_options("homebrew/ebpo.rb", setup)
    if said["depends_on"].count("meson") != 1 or len(set(said["depends_on"])) != len(said["depends_on"]):
        problems.append("homebrew/ebpo.rb: a dependency is missing, or there twice")


def check_recipe(yaml):
    text = (packaging / "conda/meta.yaml").read_text()
    filled = re.sub(r"{{ *(\w+)\((.*?)\) *}}", lambda call: f"{call[1]}-{call[2].split(',')[0].strip(chr(34))}", text)
    recipe = yaml.safe_load(filled)
    problems.extend(f"conda/meta.yaml: no {part}" for part in ("package", "source", "build", "requirements", "test", "about")
                    if part not in recipe)
    source = (packaging / "conda" / recipe["source"]["path"]).resolve()
    if source != root.resolve():
        problems.append(f"conda/meta.yaml: the source is {source}")
    if not (root / recipe["about"]["license_file"]).is_file():
        problems.append("conda/meta.yaml: license_file is not there")
    for part, names in recipe["requirements"].items():
        if len(set(names)) != len(names) or not all(re.fullmatch(r"[a-z_0-9-]+( >=[0-9.]+)?", name) for name in names):
            problems.append(f"conda/meta.yaml: requirements of {part}: {names}")
    # What is run there, with programs that say what they were given.
    said = subprocess.run(["sh", "-c", 'meson() { printf "%s\\n" "$@"; }; ninja() { :; }; . "$1"', "sh",
                           packaging / "conda/build.sh"], env={"PREFIX": "/p", "SP_DIR": "/s", "PATH": "/usr/bin:/bin"},
                          capture_output=True, text=True)
    if said.returncode:
        problems.append(f"conda/build.sh: {said.stderr}")
    check_options("conda/build.sh", said.stdout.split())


def main():
    scripts = [packaging / "build_deb.sh", packaging / "conda/build.sh",
               *(path for path in (packaging / "debian/tests").iterdir() if path.name != "control")]
    for script in scripts:
        done = subprocess.run(["sh", "-n", script], capture_output=True, text=True)
        if done.returncode:
            problems.append(f"{script.name}: {done.stderr}")
    try:
        import yaml
    except ImportError:
        yaml = None
    if yaml:
        check_recipe(yaml)
    if shutil.which("ruby"):
        check_formula()
    for problem in problems:
        print(problem)
    if problems:
        return 1
    if not yaml or not shutil.which("ruby"):
        print("no ruby, or no yaml for Python (tools/install-deps.sh --tests)")
        return 77
    print(f"{len(scripts)} scripts, a recipe and a formula")
    return 0


sys.exit(main())
