"""Reads every block of configuration of the pages that are named: TOML, JSON and YAML; a model must be one that gpsindy loads."""

import json
import pathlib
import re
import sys
import tempfile
import tomllib

import gpsindy
import yaml

BLOCK = re.compile(r"^```(toml|json|yaml)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def read(language, text):
    if language == "json":
        json.loads(text)
    elif language == "yaml":
        yaml.safe_load(text)
    elif tomllib.loads(text).get("schema", "").startswith("gpsindy.model/"):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "model.toml")
            path.write_text(text, encoding="utf-8")
            gpsindy.Model.load(path)


count, wrong = 0, []
for page in sys.argv[1:]:
    for language, text in BLOCK.findall(pathlib.Path(page).read_text(encoding="utf-8")):
        count += 1
        try:
            read(language, text)
        except Exception as error:
            wrong.append(f"{page}: a block of {language}: {error}\n{text}")
if wrong:
    sys.exit("\n".join(wrong))
print(f"  {count} blocks of configuration read")
