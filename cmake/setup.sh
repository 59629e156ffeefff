#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the Debian packages that a task needs and the machine lacks: setup.sh build|demo|test|ci
# Takes a fraction of a second where nothing is missing.
set -euo pipefail

build="build-essential cmake ninja-build pkg-config zlib1g-dev libpng-dev libjpeg62-turbo-dev libopenexr-dev
       libexpat1-dev libkissfft-dev libnetcdf-dev"
demo="ffmpeg"
tests="libcmocka-dev ffmpeg"
ci="git clang clang-format libclang-rt-14-dev libomp-dev"

case "${1:-build}" in
    build) wanted="$build" ;;
    demo) wanted="$build $demo" ;;
    test) wanted="$build $tests" ;;
    ci) wanted="$build $tests $ci" ;;
    *)
        echo "setup.sh: say build, demo, test or ci, not '$1'" >&2
        exit 2
        ;;
esac

if ! command -v dpkg-query >/dev/null; then
    # Not a Debian: the configure step names what it cannot find.
    exit 0
fi

# shellcheck disable=SC2086
installed=$(dpkg-query -W -f='${Package} ${db:Status-Status}\n' $wanted 2>/dev/null | awk '$2 == "installed" {print $1}') || true
missing=""
for package in $wanted; do
    grep -qx -- "$package" <<<"$installed" || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" = 0 ]; then
    as_root=""
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root="sudo -n"
else
    echo "setup.sh: please install these packages, then try again: apt-get install$missing" >&2
    exit 1
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
echo "setup.sh: installing$missing" >&2
for step in "update" "install -y --no-install-recommends$missing"; do
    # shellcheck disable=SC2086
    if ! $as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq $step >"$log" 2>&1 </dev/null; then
        cat "$log" >&2
        echo "setup.sh: apt-get $step failed; install by hand:$missing" >&2
        exit 1
    fi
done
