#!/usr/bin/env python3
"""test_python_refuses.py SOURCE: the specification's reader refuses frames that decode, and that the
specification does not want, and records of welding that cannot be."""
import pathlib
import sys

source = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(source / "format-spec"))
import read_ebpo

failed = source / "format-spec" / "vectors" / "failed"
for name, said in (("chunk_frame_without_checksum", "without its checksum"),
                   ("chunk_frame_with_unused_bit", "an unused bit"),
                   ("chunk_frame_repeats_once", "its byte once"),
                   ("weld_distance_0", "not finite and above 0"),
                   ("weld_distance_infinite", "not finite and above 0"),
                   ("weld_distance_without_welding", "mend_weld is 0"),
                   ("weld_moved_negative", "negative or not finite")):
    try:
        read_ebpo.read(str(failed / f"{name}.ebpo.h5"))
        sys.exit(f"{name}: read")
    except AssertionError as error:
        if said not in str(error):
            sys.exit(f"{name}: {error}")
