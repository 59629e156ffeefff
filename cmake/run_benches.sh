#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs every benchmark of a build folder, one after the other: run_benches.sh BUILD
set -euo pipefail

build=$1
found=0
for program in "$build"/bench_*; do
    [ -f "$program" ] && [ -x "$program" ] || continue
    found=1
    echo "== $(basename "$program")"
    "$program"
done
[ "$found" = 1 ] || { echo "run_benches.sh: no benchmarks in $build" >&2; exit 1; }
