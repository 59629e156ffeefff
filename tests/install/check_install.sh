#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs into a fresh folder and builds a small program against what was installed, and runs it:
# check_install.sh pkg_config|find_package|static BUILD TESTS COMPILER
set -euo pipefail

way=$1 build=$2 tests=$3 compiler=$4
prefix=$(mktemp -d)
trap 'rm -rf "$prefix"' EXIT

cmake --install "$build" --prefix "$prefix/usr" >"$prefix/log" || { cat "$prefix/log"; exit 1; }
config=$(find "$prefix/usr" -name riffle.pc -printf '%h')
lib=$(dirname "$config")

case "$way" in
    pkg_config)
        export PKG_CONFIG_PATH=$config
        # shellcheck disable=SC2046
        "$compiler" -std=c11 -Wall -Wextra -Werror "$tests/hello.c" -o "$prefix/hello" $(pkg-config --cflags --libs riffle)
        [ "$(pkg-config --modversion riffle)" = "$(LD_LIBRARY_PATH=$lib "$prefix/hello" | head -n 1)" ]
        ;;
    find_package)
        cmake -S "$tests" -B "$prefix/build" -DCMAKE_PREFIX_PATH="$prefix/usr" -DCMAKE_C_COMPILER="$compiler" \
            -DTARGET=riffle::riffle
        cmake --build "$prefix/build"
        cp "$prefix/build/hello" "$prefix/hello"
        ;;
    static)
        cmake -S "$tests" -B "$prefix/build" -DCMAKE_PREFIX_PATH="$prefix/usr" -DCMAKE_C_COMPILER="$compiler" \
            -DTARGET=riffle::riffle_static -DCOMPONENTS=static
        cmake --build "$prefix/build"
        cp "$prefix/build/hello" "$prefix/hello"
        rm "$lib"/libriffle.so*
        ;;
esac
LD_LIBRARY_PATH=$lib "$prefix/hello"
