#!/usr/bin/env bash
# Installs the package with the oldest versions that pyproject.toml allows, then with the newest,
# and tries both.
# usage: tests/bounds.sh PYTHON WHEEL
set -euo pipefail
unset PIP_CONSTRAINT PYTHONPATH VIRTUAL_ENV
here=$(cd "$(dirname "$0")" && pwd)
python=$1
wheel=$(realpath "$2")
extras=gym,train,report,deploy
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$python" - "$here/../pyproject.toml" "$extras" >"$folder/bounds.txt" <<'EOF'
import sys, tomllib
project = tomllib.load(open(sys.argv[1], "rb"))["project"]
extras = project["optional-dependencies"]
listed = [project["dependencies"], *(extras[one] for one in sys.argv[2].split(","))]
wanted = [one for part in listed for one in part if not one.startswith("innerattn")]
print(*dict.fromkeys(wanted), sep="\n")
EOF
"$python" -m venv "$folder/uv"
"$folder/uv/bin/pip" install --quiet uv
for versions in lowest-direct highest; do
  echo "$versions versions"
  "$python" -m venv "$folder/$versions"
  install=("$folder/uv/bin/uv" pip install --quiet --python "$folder/$versions/bin/python")
  "${install[@]}" --resolution "$versions" -r "$folder/bounds.txt"
  "${install[@]}" --no-deps "$wheel"
  (cd "$folder" && "$folder/$versions/bin/python" "$here/smoke.py" "$extras")
done
