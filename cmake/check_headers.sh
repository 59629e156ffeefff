#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every public header compiles alone, as C11 and as C++17, with gcc and with clang, where these are installed.
set -uo pipefail
cd "$(dirname "$0")/.."

bad=0 done=0
for header in include/riffle/*.h; do
    for compiler in gcc clang; do
        command -v "$compiler" >/dev/null || continue
        for language in "c -std=c11" "c++ -std=c++17"; do
            # shellcheck disable=SC2086
            if ! echo "#include <${header#include/}>" |
                $compiler -x $language -Wall -Wextra -Wpedantic -Werror -Iinclude -fsyntax-only -; then
                echo "$header: not clean alone with $compiler as $language"
                bad=1
            fi
            done=$((done + 1))
        done
    done
done
echo "$done compilations"
[ "$bad" = 0 ] && [ "$done" -gt 0 ]
