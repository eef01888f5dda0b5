#!/usr/bin/env python3
"""embed.py OUT.c NAME=FILE...: writes the files as C arrays, which report_page.c finds by their
names."""
import sys

out, *parts = sys.argv[1:]
names = []
with open(out, "w", encoding="ascii") as c:
    c.write('#include "cli/report/page_parts.h"\n')
    for number, part in enumerate(parts):
        name, path = part.split("=", 1)
        with open(path, "rb") as f:
            content = f.read()
        if name.endswith(".js") and b"</script" in content.lower():
            sys.exit(f"{path}: </script would end the page's script")
        names.append(name)
        c.write(f"\nstatic const char part{number}[] = {{\n")
        for i in range(0, len(content), 24):
            c.write(",".join(str(b if b < 128 else b - 256) for b in content[i:i + 24]) + ",\n")
        c.write("0\n};\n")
    c.write("\nconst page_part page_parts[] = {\n")
    for number, name in enumerate(names):
        c.write(f'    {{ "{name}", part{number}, sizeof part{number} - 1 }},\n')
    c.write("    { 0, 0, 0 },\n};\n")
