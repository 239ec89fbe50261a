#!/usr/bin/env bash
# Installs a package file into a fresh environment, tries it, adds an extra and tries that.
# usage: tests/smoke.sh PYTHON FILE [FURTHER REQUIREMENTS]
set -euo pipefail
unset PIP_CONSTRAINT PYTHONPATH VIRTUAL_ENV
here=$(cd "$(dirname "$0")" && pwd)
python=$1
file=$(realpath "$2")
shift 2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"$python" -m venv "$folder/venv"
cd "$folder" # away from the source tree
if [[ $file == *.whl ]]; then
  export PATH=$folder/venv/bin:/usr/bin:/bin # without Rust
fi
echo "$(basename "$file")${*:+ with $*}"
venv/bin/pip install --quiet "$file" "$@"
venv/bin/python "$here/smoke.py"
venv/bin/pip install --quiet "$file[gym]" "$@"
venv/bin/python "$here/smoke.py" gym
