"""Runs commands and measures time, memory, and bytes read and written, from the kernel's accounting."""
import json
import os
import pathlib
import subprocess
import tempfile
import time

MIB = 2**20


class Failed(RuntimeError):
    pass


def drop_from_memory(path):
    """Ask the system to drop a file from the page cache, so that the next read goes to the disk.

    Returns the share in percent that is still cached, or None when the share is unknown.
    """
    with open(path, "rb") as f:
        os.fsync(f.fileno())
        os.posix_fadvise(f.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    found = subprocess.run(["fincore", "-b", "-n", "-o", "RES", str(path)], capture_output=True,
                           text=True)
    return (100 * int(found.stdout) / max(1, os.path.getsize(path)) if found.returncode == 0
            and found.stdout.strip() else None)


def io_of(pid):
    """Return the I/O of a process with its threads, which has ended but is not waited for.

    The values are bytes from and to storage (with pages of mapped files), and bytes of read and write calls.
    """
    try:
        lines = dict(line.split(": ")
                     for line in pathlib.Path(f"/proc/{pid}/io").read_text().splitlines())
    except OSError:  # no permission to read
        return {}
    return {"storage_read": int(lines["read_bytes"]),
            "storage_written": int(lines["write_bytes"]) - int(lines["cancelled_write_bytes"]),
            "storage_dirtied": int(lines["write_bytes"]), "call_read": int(lines["rchar"]),
            "call_written": int(lines["wchar"])}


def run(*command, accept=(0,)):
    """Run a command. Return seconds (wall-clock, processor), peak memory, I/O and output.

    Peak memory is ru_maxrss, which includes mapped pages of files. Before the start, data that other programs have written
    is flushed to the disk.
    """
    command = [str(c) for c in command]
    os.sync()
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        begin = time.monotonic()
        process = subprocess.Popen(command, stdout=out, stderr=err, stdin=subprocess.DEVNULL)
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        wall, io = time.monotonic() - begin, io_of(process.pid)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        err.seek(0)
        printed, problem = out.read(), err.read().strip()
    if process.returncode not in accept:
        lines = problem.splitlines()
        raise Failed(f"{pathlib.Path(command[0]).name} {command[1]}: "
                     f"{lines[-1] if lines else 'ended with ' + str(process.returncode)}")
    return {"wall": wall, "cpu": usage.ru_utime + usage.ru_stime, "system": usage.ru_stime,
            "peak": usage.ru_maxrss * 1024, "major_faults": usage.ru_majflt,
            **io, "printed": printed, "code": process.returncode}


def run_json(*command, accept=(0,)):
    """Run a command as `run`, with its JSON output as `report`."""
    figures = run(*command, accept=accept)
    figures["report"] = json.loads(figures.pop("printed"))
    return figures


def machine():
    """Return processor, cores, memory and system as a text, without the machine's name."""
    model = next((line.split(":", 1)[1].strip() for line in open("/proc/cpuinfo")
                  if line.startswith("model name")), "unknown processor")
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return (f"{model}, {len(os.sched_getaffinity(0))} cores, {memory / 2**30:.0f} GiB of memory, "
            f"Linux {os.uname().release.split('-')[0]}")
