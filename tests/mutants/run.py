#!/usr/bin/env python3
"""Mutation testing: applies one mutation at a time to a copy of the sources, builds, runs tests and lists the survivors.

    run.py [--time SECONDS] [--only WORD] [--named] BUILD
    run.py --apply

The file `list` beside this one has a line for each mutation:

    FUNCTION | EXPRESSION => REPLACEMENT | TEST...
    FUNCTION | EXPRESSION => REPLACEMENT | equivalent: REASON

FUNCTION is the name of a function, table or macro of core/, solvers/, models/ or tests/support/, or `Makefile`; EXPRESSION must
occur in it exactly once (white space is ignored; write a | b as a|b).  A mutation that does not apply is an error.  The TESTs named run first; if they
all pass, every quick test runs, unless --named is given.  Mutants that are equivalent to the original for the stated reason are
listed but not run.

Verdicts are kept in BUILD/results while the sources and the test that detects the mutant stay the same, so an interrupted run
continues.  The exit status is 0
if no mutant survived, 1 if one did or does not apply, 3 if the time was not sufficient for all.
"""
import argparse, functools, hashlib, os, re, shutil, subprocess, sys, time

HERE = os.path.dirname(os.path.abspath(__file__))
TOP = os.path.dirname(os.path.dirname(HERE))
ROOTS = ("core/", "solvers/", "models/", "tests/support/")
TEST_LIMIT = 240  # seconds for a test program; the slowest takes about 20 without a mutation


def sources():
    out = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=TOP, capture_output=True, text=True, check=True)
    return [f for f in out.stdout.splitlines() if os.path.isfile(os.path.join(TOP, f))]


def definitions(text):
    """(name-bearing header, start, end) of each definition at file level and of each macro."""
    lines, start, header = text.splitlines(keepends=True), None, ""
    position = 0
    macro = None
    for line in lines:
        end = position + len(line)
        if macro is not None or line.startswith("#define"):
            if macro is None:
                macro = position
            if not line.rstrip().endswith("\\"):
                yield re.match(r"#define\s+(\w+)", text[macro:end]).group(1), macro, end
                macro = None
        elif start is None and re.match(r"[A-Za-z_]", line):
            start = position
            if ";" in line and "{" not in line:
                yield line, start, end
                start = None
        if start is not None and (re.match(r"}(?!.*{$)", line.rstrip()) or ("{" in line and "}" in line and text.startswith(line, start))):
            yield text[start:end].split("{")[0], start, end
            start = None
        elif start is not None and macro is None and "{" not in text[start:end] and re.search(r";$|^$", line.rstrip()):
            start = None  # a declaration, or a macro that defines functions
        position = end


def pattern(expression):
    return re.compile(r"\s*".join(re.escape(word) for word in re.findall(r"\w+|[^\w\s]", expression)))


def apply(mutation, files):
    """(file, mutated text), or an explanation why the mutation does not apply."""
    name, found = re.compile(r"(?<!\w)" + re.escape(mutation["function"]) + r"(?!\w)(?=\s*[(\[=]|\s*$)"), []
    places = 0
    for path, text in files.items():
        if mutation["function"] not in path + text:
            continue
        for header, start, end in [(path, 0, len(text))] if path == "Makefile" else definitions(text):
            if name.search(re.sub(r"^(PER_ELEMENT|PREPARE) \((\w+).*", r"\2 (", header.strip(), flags=re.S)):
                places += 1
                for m in pattern(mutation["expression"]).finditer(text, start, end):
                    found.append((path, text[:m.start()] + mutation["replacement"] + text[m.end():]))
    if not places:
        return None, "there is no such function"
    if len(found) != 1:
        return None, f"the expression occurs {len(found)} times, expected once"
    return found[0], ""


def read_list(path):
    with open(path) as f:
        for number, line in enumerate(f, 1):
            line = line.strip()
            if not line or line.startswith("#"):
                continue
            parts = [p.strip() for p in line.split(" | ")]
            if len(parts) != 3 or " => " not in parts[1] + " ":
                sys.exit(f"{path}:{number}: expected FUNCTION | EXPRESSION => REPLACEMENT | TEST...")
            old, new = (parts[1] + " ").split(" => ", 1)
            yield {"line": number, "text": line, "function": parts[0], "expression": old.strip(), "replacement": new.strip(),
                   "equivalent": parts[2][11:].strip() if parts[2].startswith("equivalent:") else "",
                   "tests": [] if parts[2].startswith("equivalent:") else parts[2].split()}


class Copy:
    """The copy of the tree that is mutated, and its build."""

    def __init__(self, build, names):
        self.top = os.path.join(build, "source")
        for folder, folders, old in os.walk(self.top):  # files that have been moved
            if folder == self.top and "build" in folders:
                folders.remove("build")
            for name in old:
                path = os.path.join(folder, name)
                if os.path.relpath(path, self.top) not in names:
                    os.remove(path)
        for name in names:
            there = os.path.join(self.top, name)
            here = os.path.join(TOP, name)
            if not os.path.exists(there) or open(there, "rb").read() != open(here, "rb").read():
                os.makedirs(os.path.dirname(there), exist_ok=True)
                shutil.copyfile(here, there)
                shutil.copymode(here, there)
        self.names = names

    def make(self, *targets):
        return subprocess.run(["make", "-s", f"-j{os.cpu_count()}", "NO_DEPS=1", "BUILD=build", *targets], cwd=self.top, text=True,
                              stdin=subprocess.DEVNULL, capture_output=True)

    def test(self, tests):
        """The name of the first test that fails, "" if all pass."""
        for test in tests:
            script = test.endswith(".sh")
            target = next(n for n in self.names if os.path.basename(n) == test) if script else f"build/tests/{test}"
            made = self.make("all", *([] if script else [target]))
            if made.returncode:
                return "the compiler" if "error:" in made.stderr else "make: " + made.stderr.strip()[-200:]
            env = dict(os.environ, BUILD="build", PINWHEEL="build/pinwheel", LIMIT=str(TEST_LIMIT))
            run = subprocess.run(["sh", ".ci/run-tests", target], cwd=self.top, env=env, stdin=subprocess.DEVNULL,
                                 capture_output=True, text=True)
            if run.returncode:
                return test
        return ""

    def write(self, name, text):
        with open(os.path.join(self.top, name), "w") as f:
            f.write(text)


@functools.lru_cache(maxsize=None)
def digest(names):
    digest = hashlib.sha256()
    for n in names:
        with open(os.path.join(TOP, n), "rb") as f:
            digest.update(n.encode() + f.read())
    return digest.hexdigest()[:16]


def state(names, test):
    """What a verdict depends on: all sources but other tests, if a test has detected the mutant."""
    kept = (n for n in names if not n.startswith(("docs/", "tests/mutants/")))
    return digest(tuple(n for n in kept if not test or not re.fullmatch(r"tests/\w+/test_\w+\.c", n) or n.endswith(f"/{test}.c")))


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--time", type=float, default=7200, help="stop after this many seconds")
    options.add_argument("--only", default="", help="mutations whose line contains this")
    options.add_argument("--named", action="store_true", help="only the tests named in the list; survivors are not noted")
    options.add_argument("--apply", action="store_true", help="only check that every mutation applies")
    options.add_argument("build", nargs="?", default="build/variant/mutants")
    options = options.parse_args()
    mutations = list(read_list(os.path.join(HERE, "list")))
    names = sources()
    files = {n: open(os.path.join(TOP, n)).read() for n in names if n == "Makefile" or n.startswith(ROOTS) and n.endswith((".c", ".h"))}
    tests, wrong = {os.path.basename(n) for n in names if n.startswith("tests/")}, 0
    for m in mutations:
        m["applied"], why = apply(m, files)
        unknown = [t for t in m["tests"] if not {t, t + ".c"} & tests]
        if unknown:
            m["applied"], why = None, f"there is no test {unknown[0]}"
        if m["applied"] is None:
            print(f"tests/mutants/list:{m['line']}: {m['text']}: does not apply: {why}")
            wrong += 1
    if options.apply or wrong:
        print(f"{len(mutations)} mutations, {wrong} do not apply")
        return 1 if wrong else 0

    os.makedirs(options.build, exist_ok=True)
    path, verdicts = os.path.join(options.build, "results"), {}
    if os.path.exists(path):
        for line in open(path):
            key, text, verdict = line.rstrip("\n").split("\t")
            if key == state(names, verdict):
                verdicts[text] = verdict
    quick = sorted(os.path.basename(n)[:-2] for n in names if re.fullmatch(r"tests/\w+/test_\w+\.c", n))

    copy, begin, left, survivors = Copy(options.build, names), time.time(), 0, 0
    todo = [m for m in mutations if options.only in m["text"]]
    needed = sorted({t for m in todo for t in m["tests"]})
    failed = copy.test(needed) if any(m["text"] not in verdicts for m in todo if not m["equivalent"]) else ""
    if failed:
        sys.exit(f"without any mutation: {failed} fails")
    for i, m in enumerate(todo):
        if m["equivalent"]:
            print(f"equivalent  {m['text']}")
            continue
        if m["text"] not in verdicts:
            if time.time() - begin > options.time:
                left += 1
                continue
            name, text = m["applied"]
            copy.write(name, text)
            others = [] if options.named else [q for q in quick if q not in m["tests"]]
            verdicts[m["text"]] = copy.test(m["tests"]) or copy.test(others)
            copy.write(name, files[name])
            if verdicts[m["text"]] or not options.named:
                with open(path, "a") as f:
                    f.write(f"{state(names, verdicts[m['text']])}\t{m['text']}\t{verdicts[m['text']]}\n")
        by = verdicts[m["text"]]
        survivors += by == ""
        print(f"{'detected' if by else 'SURVIVED'}    {m['text']}" + (f"    by {by}" if by else ""), flush=True)
    print(f"{len(todo) - survivors - left} passed, {survivors} failed" + (f", {left} skipped" if left else ""))
    return 1 if survivors else 3 if left else 0


if __name__ == "__main__":
    sys.exit(main())
