"""The notebooks and the code of docs/python.md run, cell by cell in this interpreter."""

import contextlib
import io
import json
import os
import re
import tempfile
import unittest
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((FOLDER / "notebooks").glob("*.ipynb"))
PAGE = FOLDER.parent / "docs" / "python.md"


class Pages(unittest.TestCase):
    def run_all(self, cells, name):
        """In an empty folder, one after the other."""
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                names = {"__name__": name}
                for number, cell in enumerate(cells, 1):
                    with contextlib.redirect_stdout(io.StringIO()):
                        exec(compile(cell, f"{name}, cell {number}", "exec"), names)
            finally:
                os.chdir(before)

    def test_notebooks(self):
        self.assertEqual(len(NOTEBOOKS), 4)
        for path in NOTEBOOKS:
            with self.subTest(path.name):
                notebook = json.loads(path.read_text(encoding="utf-8"))
                code = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
                for cell in notebook["cells"]:
                    self.assertFalse(cell.get("outputs"), "outputs are not kept")
                self.run_all(code, path.name)

    def test_the_page(self):
        code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
        self.assertGreaterEqual(len(code), 5)
        self.run_all(code, PAGE.name)


if __name__ == "__main__":
    unittest.main()
