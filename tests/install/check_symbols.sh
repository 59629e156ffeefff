#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The shared library exports exactly the functions that include/riffle declares RF_API: check_symbols.sh SOURCE LIBRARY
set -euo pipefail

declared=$(cat "$1"/include/riffle/*.h | tr '\n' ' ' | grep -oE 'RF_API [^;(]*\(' | grep -oE 'rf_[a-z0-9_]+ *\($' | tr -d ' (' | sort -u)
# Names that begin with _ are the compiler's, the linker's or a sanitizer's.
exported=$(nm -D --defined-only "$2" | awk '{print $3}' | grep -v '^_' | sort -u)
hidden=$(comm -13 <(echo "$declared") <(echo "$exported"))
absent=$(comm -23 <(echo "$declared") <(echo "$exported"))
[ -z "$hidden" ] || echo "exported, but declared in no public header:" $hidden
[ -z "$absent" ] || echo "declared, but not in the library:" $absent
[ -n "$declared" ] && [ -z "$hidden$absent" ]
