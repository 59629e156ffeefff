#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The first block of C in README.md stands, line by line, in examples/texture.c between its marks.
set -euo pipefail

source_dir=$1
block() { sed -e 's/^ *//' -e '/^$/d'; }
readme=$(awk '/^```c$/ {on = 1; next} /^```$/ {if (on) exit} on' "$source_dir/README.md" | block)
example=$(awk '/README begins/ {on = 1; next} /README ends/ {exit} on' "$source_dir/examples/texture.c" | block)
[ -n "$example" ] || { echo "examples/texture.c has no lines between its marks"; exit 1; }
diff <(echo "$readme") <(echo "$example")
