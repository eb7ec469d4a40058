"""Run every script of this folder, and write the record of what they printed.

    python benchmarks/record.py [--quick | --gather] [--data FOLDER] [NAME ...]

In full size the record is benchmarks/RECORD.md, put together from benchmarks/results; with --quick
all is small, and goes into runs/bench. NAMEs: run these only; the others are as they last were, and
with --gather all are. Then the tables that README and docs quote are renewed, and numbers in them
that are in no result any more are printed.
"""

import argparse
import re
import subprocess
import sys
import time
from pathlib import Path

from common import DETAILS, RESULTS

HERE = Path(__file__).parent
#: In the order of the record.
SCRIPTS = (
    "speed", "operators", "orders", "adaptive_orders", "referee", "gains",
    "supervisor", "validation", "published_laws", "views", "exported_float",
)  # fmt: skip
#: Those that take longer are run, and their results kept, by hand.
LONG = ("torture", "mutants")
HEAD = """# Record

What the scripts of this folder answer, with their tables and what these were printed on, put
together by `make bench`. Times depend on the machine: read ratios, and calls of `pin.aba`."""


def summary(path: Path) -> str:
    """Return what a file of results has for the record, its links as seen from there."""
    text, details, _ = path.read_text(encoding="utf-8").partition(f"\n{DETAILS}")
    folder = f"{path.parent.name}/"
    text = re.sub(r"\]\((?!http|#)", f"]({folder}", text).replace(f"({folder}../", "(")
    more = f"\nAll tables: [{folder}{path.name}]({folder}{path.name}).\n" if details else ""
    return text.rstrip() + "\n" + more


def main() -> int:
    """Run what is asked for; return how many scripts failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SCRIPTS))
    parser.add_argument("--quick", action="store_true", help="small sizes, into runs/bench")
    parser.add_argument("--gather", action="store_true", help="run none, only write the record")
    parser.add_argument("--data", type=Path, help="of validation.py")
    given = parser.parse_args()
    if unknown := set(given.names) - set(SCRIPTS):
        parser.error(f"names are {', '.join(SCRIPTS)}; got {', '.join(sorted(unknown))}")
    out = Path("runs/bench/results") if given.quick else RESULTS
    words = ["--quick", "--out", str(out)] if given.quick else []
    words += ["--data", str(given.data)] if given.data else []
    failed = []
    for name in () if given.gather else given.names or SCRIPTS:
        began = time.monotonic()
        done = subprocess.run([sys.executable, HERE / f"{name}.py", *words])
        print(f"--- {name}: {time.monotonic() - began:.0f} s\n", flush=True)
        failed += [name] if done.returncode else []
    files = [out / f"{name}.md" for name in (*SCRIPTS, *LONG)]
    there = [path for path in files if path.exists()]
    record = out.parent / "RECORD.md"
    record.write_text("\n".join([HEAD, "", *map(summary, there)]), encoding="utf-8")
    print(f"Record: {record}" + (f"; failed: {', '.join(failed)}" if failed else ""), flush=True)
    if not given.quick:
        # Tables that pages quote, and numbers in them that the results no longer hold.
        subprocess.run([sys.executable, HERE.parent / "docs" / "published_numbers.py"])
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
