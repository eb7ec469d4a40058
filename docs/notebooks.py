"""Run the notebooks of examples/ and store what they print and show, pictures in few colours.

    pip install nbclient ipykernel
    python docs/notebooks.py

The site shows them as they are stored (docs/site.py), and the tests compare what they print.
"""

from __future__ import annotations

import base64
import io
import os
import sys
import tempfile
from pathlib import Path

EXAMPLES = Path(__file__).parents[1] / "examples"
COLOURS = 48
#: Bytes of a notebook, so that it is read quickly everywhere.
LARGEST = 400_000


def smaller(png: str) -> str:
    """Return a picture, in base64, with fewer colours."""
    from PIL import Image

    small = io.BytesIO()
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    picture.quantize(COLOURS).save(small, "png", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def main() -> int:
    """Run all of them; return how many are too large."""
    import nbclient
    import nbformat

    large = 0
    for path in sorted(EXAMPLES.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
            os.chdir(EXAMPLES)
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                if "image/png" in data:
                    data["image/png"] = smaller(data["image/png"])
        notebook.metadata = {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
        nbformat.write(notebook, path)
        size = path.stat().st_size
        large += size > LARGEST
        print(f"{path.name}: {size / 1000:.0f} kB of at most {LARGEST / 1000:.0f}")
    return large


if __name__ == "__main__":
    sys.exit(main())
