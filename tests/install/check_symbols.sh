#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The shared library exports exactly the functions that include/riffle declares RF_API, and every global symbol of the
# static one begins with rf_, so that it meets no other in a program: check_symbols.sh SOURCE SHARED STATIC
set -euo pipefail

declared=$(cat "$1"/include/riffle/*.h | tr '\n' ' ' | grep -oE 'RF_API [^;(]*\(' | grep -oE 'rf_[a-z0-9_]+ *\($' | tr -d ' (' | sort -u)
# Names that begin with _ are the compiler's, the linker's or a sanitizer's.
exported=$(nm -D --defined-only "$2" | awk '{print $3}' | grep -v '^_' | sort -u)
hidden=$(comm -13 <(echo "$declared") <(echo "$exported"))
absent=$(comm -23 <(echo "$declared") <(echo "$exported"))
strange=$(nm -g --defined-only "$3" 2>/dev/null | awk 'NF == 3 {print $3}' | grep -vE '^(rf_|_)' | sort -u || true)
[ -z "$hidden" ] || echo "exported, but declared in no public header:" $hidden
[ -z "$absent" ] || echo "declared, but not in the library:" $absent
[ -z "$strange" ] || echo "global in the static library without rf_:" $strange
[ -n "$declared" ] && [ -z "$hidden$absent$strange" ]
