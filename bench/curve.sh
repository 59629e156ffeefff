#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The curve between following the flow and keeping the look: one line a setting and exemplar, as docs/lagrangian.md shows it.
#   bench/curve.sh BENCH_QUALITY [FRAMES]
set -euo pipefail
bench=$1
frames=${2:-100}
settings=("" "preset=paper" "max-distortion=1.5" "max-distortion=3" "max-distortion=5" "relaxation=0" "relaxation=1" "relaxation=4" "relaxation=10" "particle-radius=16 relaxation=10"
    "fade=0.25 adapt=0" "fade=1 adapt=0"
    "fade=5 adapt=0" "sharpness=1" "sharpness=4" "sharpness=8" "candidates=1" "candidates=64" "candidates=1024"
    "blend=0" "blend=2")
for setting in "${settings[@]}"; do
    for exemplar in foam bubbles noise; do
        # shellcheck disable=SC2086
        "$bench" "builtin:$exemplar" "frames=$frames" every=20 $setting label="${setting:-defaults}," | sed 's/builtin://'
    done
done
