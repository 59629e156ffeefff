#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the tests of a build folder and counts: run_tests.sh BUILD [options of ctest]
# Every cmocka test counts as one, and every CTest test that is no cmocka program. Skipped and failed ones are named.
# The last line is "N passed, N failed, N skipped"; the exit status is not 0 if anything failed.
# Two programs run at a time (CTEST_PARALLEL_LEVEL): most use one thread for half of their time. Idle threads sleep
# (OMP_WAIT_POLICY); by default they spin, which takes the processor from the other program and helps none.
set -uo pipefail
export CTEST_PARALLEL_LEVEL=${CTEST_PARALLEL_LEVEL:-2} OMP_WAIT_POLICY=${OMP_WAIT_POLICY:-passive}

build=$1
shift
log="$build/Testing/Temporary/LastTest.log"
rm -f "$log"
verdicts=$(mktemp)
trap 'rm -f "$verdicts"' EXIT
ctest --test-dir "$build" --no-tests=error --output-on-failure "$@" </dev/null 2>&1 | tee "$verdicts"
status=${PIPESTATUS[0]}
[ -f "$log" ] || log=/dev/null

# The first file is what ctest printed, with each program's verdict; the second what the programs themselves printed.
awk -v status="$status" '
    # Ends one program. Its verdict counts where cmocka gave none, or where it died in or after its last test.
    function finish()
    {
        if (!program)
            return
        if (verdict[program] == "failed" && !failed_here)
            fail(program (test ? ": " test : "") ", " cause[program])
        else if (verdict[program] == "skipped")
            skip(program, last)
        else if (verdict[program] == "passed" && !cmocka)
            ++passed
        program = test = last = ""
        cmocka = failed_here = 0
    }
    function fail(what) { ++failed; ++failed_here; failures = failures "failed: " what "\n" }
    function skip(what, why) { sub(/^skipped: /, "", why); ++skipped; skips = skips "skipped: " what ": " (why ? why : "no reason given") "\n" }

    NR == FNR && match($0, /Test +#[0-9]+: /) {
        split(substr($0, RSTART + RLENGTH), word, " ")
        kind = "failed"
        if ($0 ~ / Passed +[0-9.]+ sec/)
            kind = "passed"
        else if ($0 ~ /\*\*\*Skipped/)
            kind = "skipped"
        verdict[word[1]] = kind
        cause[word[1]] = $0 ~ /\*\*\*Timeout/ ? "ran too long" : $0 ~ /\*\*\*Not Run/ ? "could not be started" : "ended with an error"
    }
    NR == FNR { next }

    /^[0-9]+\/[0-9]+ Testing: / { finish(); program = $3; next }
    /^\[ RUN      \] / { test = substr($0, 14); cmocka = 1; last = ""; next }
    test && /^\[       OK \] / { ++passed; test = ""; next }
    test && /^\[  SKIPPED \] / { skip(program ": " test, last); test = ""; next }
    test && /^\[  FAILED  \] / { fail(program ": " test); test = ""; next }
    /^<end of output>$/ { ended = 1; next }
    /^Output:$/ { ended = 0; next }
    NF && !ended && !/^-+$/ { last = $0 }
    END {
        finish()
        if (status != 0 && !failed)
            fail("ctest ended with " status)
        printf "%s%s%d passed, %d failed, %d skipped\n", skips, failures, passed, failed, skipped
        exit failed > 0
    }
' "$verdicts" "$log"
