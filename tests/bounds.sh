#!/usr/bin/env bash
# Installs the package with the oldest versions that pyproject.toml allows, then with the newest,
# and tries both.
# usage: tests/bounds.sh PYTHON WHEEL
set -euo pipefail
unset PIP_CONSTRAINT PYTHONPATH VIRTUAL_ENV
here=$(cd "$(dirname "$0")" && pwd)
python=$1
wheel=$(realpath "$2")
extras=gym,train,report,deploy,maps,search,log,ray,torchrl
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
try_with() { # VERSIONS
  local install=("$folder/uv/bin/uv" pip install --quiet --python "$folder/$1/bin/python")
  "$python" -m venv "$folder/$1"
  "${install[@]}" --resolution "$1" -r "$folder/bounds.txt"
  "${install[@]}" --no-deps "$wheel"
  mkdir "$folder/in-$1"
  (cd "$folder/in-$1" && "$folder/$1/bin/python" "$here/smoke.py" "$extras")
  echo "$1 versions: passed"
}
(try_with highest) & # both at once: much of it waits for the network
(try_with lowest-direct)
wait $!
