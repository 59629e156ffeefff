#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Each rival's main parameters swept, as docs/dual.md, docs/eulerian.md and docs/sprites.md show it: a line a setting and
# exemplar, with lagrangian and warp to compare with. Every 11th frame is judged, so that no period is met at one phase.
#   bench/rivals.sh BENCH_QUALITY [FRAMES]
set -euo pipefail
bench=$1
frames=${2:-198}
settings=("lagrangian" "paper" "warp"
    "dual reset-every=8" "dual reset-every=12" "dual reset-every=16" "dual" "dual reset-every=32" "dual reset-every=48"
    "dual reset-every=96" "dual scatter=0" "dual blend=0" "dual blend=0 scatter=0"
    "eulerian" "eulerian latency=16 max-distortion=1.4" "eulerian max-distortion=1.5"
    "eulerian phases=3" "eulerian blend=0" "eulerian layers=1" "eulerian layers=1 latency=96"
    "sprites" "sprites turn=0" "sprites fade=0.5" "sprites fade=2" "sprites particle-radius=14" "sprites particle-radius=32"
    "sprites candidates=1")
for setting in "${settings[@]}"; do
    for exemplar in foam noise; do
        # shellcheck disable=SC2086
        "$bench" "builtin:$exemplar" "frames=$frames" every=11 method=$setting label="$setting," | sed 's/builtin://'
    done
done
