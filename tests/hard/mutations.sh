#!/usr/bin/env bash
# tests/hard/mutations.sh [WORD]: swaps the naive formulas of hard cases in, one at a time, and requires that the test
# that stands for the case then fails. In a copy of the tree (build/mutations), so that nothing of the tree is touched;
# every test is first seen to pass there. WORD: only the mutations in whose line (case, file,
# test, words) this regular expression is found: '^9 ' is case 9. Prints a line each, with what
# the test says of the naive formula. Part of ./test --full. What is not seen to fail as it should (a formula that is no
# longer there, a test that passes, is not found, or takes more than 15 minutes) makes the exit code 1.
# mutations.sh --check: builds nothing; every formula of the list stands once in the tree, and its test is there. LIST
# (environment): another list (names.sh plants wrong ones).
#
# Each test file is a program of its own there, built as the tree's build folder is, so that ccache has what did not
# change. Of a formula in a header that half of the tree includes, a mutation names the files that are compiled with it
# (only=GLOBS): the test itself, where it looks at values, or the kernels of this machine ($kernels), where it draws.
# All others keep the right formula. Without only=, all that includes the header is compiled anew. (Nothing is precompiled
# there: a header that was would be there twice.)
set -u
tree=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
copy=$tree/build/mutations
list=${LIST:-$tree/tests/hard/mutations.list}
word=${1:-}
isChecking=
if [ "$word" = --check ]; then
    word=
    isChecking=1
fi
# (Of a file that bash cannot read to its end, it would take the first half.)
bash -n "$list" || { echo "no list: $list"; exit 2; }
status=0
count=0
declare -A passed=()
set=sse  # the only kernels there: others would draw what they always draw
grep -q avx2 /proc/cpuinfo && set=avx2
grep -q avx512bw /proc/cpuinfo && set=avx512
kernels=engine/cpu/kernels_$set.cpp

# The tree's files as they are now; those that did not change keep their times, those that are gone go.
refresh() {
    local f
    local -a files=(git -C "$tree" ls-files -z --cached --others --exclude-standard)
    sums() { (cd "$1" && "${files[@]}" | xargs -0 -r cksum 2>/dev/null | sort); }
    while IFS= read -r f; do
        mkdir -p "$copy/$(dirname "$f")"
        cp "$tree/$f" "$copy/$f"
    done < <(comm -23 <(sums "$tree") <(sums "$copy") | cut -d ' ' -f 3-)
    while IFS= read -r f; do
        rm "$copy/$f"
    done < <(comm -13 <("${files[@]}" | tr '\0' '\n' | sort) <(cd "$copy" && find apps engine lod shaders streaming tests -type f 2>/dev/null | sort))
}
# What compiles: through ccache, if there is one. A naive formula may leave something unused: no warnings of it; and
# kernels with one are not worth a minute of the compiler (what they compute does not hang on how well they are
# compiled: nothing is contracted or put in another order).
write_compiler() {
    cat >"$copy/compiler" <<END
#!/bin/sh
no=
[ -e "$copy/mutated" ] && no=-w
case "\$no\$*" in -w*/kernels_*) no='-w -O1' ;; esac
exec $(command -v ccache) "\$@" \$no
END
    chmod +x "$copy/compiler"
}
build() { ninja -C "$copy/build" "$1" >"$copy/build.log" 2>&1; }
run() {  # PROGRAM FILTER: the test's own exit code; 200 where no test of that name ran
    timeout 900 "$copy/build/tests/$1" --gtest_filter="$2" >"$copy/run.log" 2>&1
    local code=$?
    grep -qE '^\[==========\] [1-9][0-9]* tests? from .* ran\.' "$copy/run.log" || [ $code -ne 0 ] || code=200
    return $code
}
# FILE OLD NEW: the only place where OLD stands.
swap() {
    [ -f "$copy/$1" ] || { echo "not there: $1" >&2; return 1; }
    FROM=$2 TO=$3 perl -0777 -pi -e '
        my $n = () = /\Q$ENV{FROM}\E/g;
        die "stands $n times in $ARGV: $ENV{FROM}\n" if $n != 1;
        s/\Q$ENV{FROM}\E/$ENV{TO}/;' "$copy/$1"
}
# The files of a mutation's only=, or nothing where one of the globs has none.
filesOf() { (cd "$1" && shopt -s failglob && echo $2) 2>/dev/null; }
# What mutant is called with, NUL after each, in the tree: one process for all of them.
checkAll() {
    cd "$tree" && perl -0 -e '
        my ($count, $status) = (0, 0);
        sub slurp { open(my $in, "<", $_[0]) or return undef; local $/; return scalar <$in>; }
        chomp(my @fields = <STDIN>);
        while (@fields) {
            my ($n, $only) = splice(@fields, 0, 2);
            my ($case, $test, $filter, $words, @swaps) = splice(@fields, 0, $n);
            my $bad = sub { print "NOT THERE     case $case: $words ($filter): $_[0]\n"; $status = 1; };
            my ($suite, $name) = split(/\./, $filter, 2);
            $name = join("[A-Za-z0-9]*", map { quotemeta } split(/\*/, $name, -1));
            (slurp("tests/$test") // "") =~ /^TEST(_F|_P)?\($suite, $name\)/m or $bad->("no such test in $test");
            for my $glob (split(" ", $only)) { grep { -e } glob($glob) or $bad->($glob); }
            $bad->("not files, formulas and naive formulas") if !@swaps || @swaps % 3;
            my %text;
            while (my ($file, $old, $new) = splice(@swaps, 0, 3)) {
                $text{$file} //= slurp($file);
                my $times = () = ($text{$file} // "") =~ /\Q$old\E/g;
                $bad->("its formula stands $times times in $file") if $times != 1;
                $bad->("it changes nothing") if $old eq ($new // $old);
                $text{$file} =~ s/\Q$old\E/$new/ if $times == 1;
            }
            ++$count;
        }
        print "no mutations\n" if !$count;
        exit($count ? $status : 2);'
}
# CASE TEST_FILE FILTER WORDS FILE OLD NEW [FILE OLD NEW ...]; before it: only='GLOB ...'
mutant() {
    if [ -n "$isChecking" ]; then printf '%s\0' $# "${only:-}" "$@"; return; fi
    local case=$1 program=single_$(basename "$2" .cpp) filter=$3 words=$4 globs=${only:-}
    [[ "$case $2 $filter $words" =~ $word ]] || return 0
    if [ -n "${isListing:-}" ]; then files+=("$2"); return 0; fi
    shift 4
    count=$((count + 1))
    local line="case $case: $words ($filter)"
    local changed=() compiled=() f said
    if ! build "$program" || { [ -z "${passed[$filter]:-}" ] && ! run "$program" "$filter"; }; then
        echo "NOT MEASURED  $line: it fails without the mutation, or does not build (exit $?)"
        status=1
        return
    fi
    passed[$filter]=1
    touch "$copy/mutated"
    while [ $# -gt 0 ]; do
        if [ ! -e "$copy/before/$1" ]; then
            changed+=("$1")
            mkdir -p "$copy/before/$(dirname "$1")"
            cp -p "$copy/$1" "$copy/before/$1"
        fi
        if ! swap "$1" "$2" "$3"; then
            echo "NOT MEASURED  $line: the formula is no longer there"
            status=1
            changedBack
            return
        fi
        shift 3
    done
    if [ -n "$globs" ]; then  # all but these keep what they were compiled from
        if [ -z "$(filesOf "$copy" "$globs")" ]; then
            echo "NOT MEASURED  $line: no file is $globs"
            status=1
            changedBack
            return
        fi
        for f in "${changed[@]}"; do touch -r "$copy/before/$f" "$copy/$f"; done
        read -ra compiled < <(cd "$copy" && echo $globs)
        (cd "$copy" && touch "${compiled[@]}")
    fi
    if ! build "$program"; then
        echo "NOT MEASURED  $line: the naive formula does not compile"
        grep -m3 'error' "$copy/build.log"
        status=1
    elif run "$program" "$filter" 2>/dev/null; then
        echo "SURVIVED      $line"
        status=1
    else
        local code=$?
        # (What hangs may hang for another reason; of 200 see run().)
        if [ $code -eq 124 ] || [ $code -eq 200 ]; then
            echo "NOT MEASURED  $line: it ends with $code"
            status=1
            changedBack
            return
        fi
        said=$(grep -aA6 -m1 ': Failure' "$copy/run.log" | tail -n +2 | tr -s ' \n' ' ' | cut -c -150)
        [ -n "$said" ] || said="it stops with $code"
        echo "killed        $line: $(grep -ac ': Failure' "$copy/run.log") failures; $said"
    fi
    changedBack
}
changedBack() {
    rm -f "$copy/mutated"
    for f in "${changed[@]}"; do
        cp -p "$copy/before/$f" "$copy/$f"
        rm "$copy/before/$f"
        [ ${#compiled[@]} -gt 0 ] || touch "$copy/$f"
    done
    [ ${#compiled[@]} -eq 0 ] || (cd "$copy" && touch "${compiled[@]}")
}

if [ -n "$isChecking" ]; then
    source "$list" | checkAll
    exit
fi
mkdir -p "$copy"
rm -rf "$copy/mutated" "$copy/before"
refresh
write_compiler
files=()
isListing=1
source "$list"
isListing=
[ ${#files[@]} -gt 0 ] || { echo "no mutation has '$word' in its line"; exit 2; }
unity=OFF
grep -qs '^CMAKE_UNITY_BUILD:[A-Z]*=ON' "$tree/build/CMakeCache.txt" && unity=ON
export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$tree} CCACHE_NOHASHDIR=1
cmake -S "$copy" -B "$copy/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTIPPLE_GPU=OFF -DCMAKE_UNITY_BUILD=$unity \
    -DSTIPPLE_PRECOMPILED=OFF \
    -DSTIPPLE_KERNELS=$set -DCCACHE="$copy/compiler" -DSTIPPLE_SINGLE_TESTS="$(printf '%s\n' "${files[@]}" | sort -u | paste -sd ';')" \
    >"$copy/configure.log" 2>&1 || { echo "the copy is not configured: $copy/configure.log"; exit 1; }
source "$list"
echo "$count mutations"
exit $status
