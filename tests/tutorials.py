#!/usr/bin/env python3
"""Runs the commands of a page of docs/tutorials or docs/how-to, or of an example's README.md, in a fresh folder, as a reader would
type them.

  tutorials.py install BUILD SOURCE          installs the build for the pages, into BUILD/pages
  tutorials.py run BUILD SOURCE PAGE.md      runs one page; status 1 where a command fails or prints something else
  tutorials.py show BUILD SOURCE PAGE.md     the same, and shows the true output of each block, for who writes a page
  tutorials.py list SOURCE                   the blocks that are not run, each with its reason
  tutorials.py complete SOURCE PAGE.md...    fails where such a page is not among the arguments
  tutorials.py self-test                     faults of a page are seen

A page's blocks are run in order by one shell, so a folder or a variable of one block holds in the next. A comment on the line before a
block says how it is meant:

  ```sh                           is run; each command must succeed
  <!-- status 2 --> ```sh         is run; its last command must end with this status
  <!-- not run: REASON --> ```sh  needs root, another host or a device: shown by `list`
  <!-- file NAME --> ```cpp       is written to the file NAME in the folder where the shell stands
  ```text                         is the output of the sh block before it; a line `...` stands for any lines, also none,
                                  and `...` at the end of a line for any words
  <!-- sketch --> ```text         is no output

Blanks count as one blank. Two numbers are equal where they differ by at most a tenth of the larger one: another processor rounds
otherwise. Everything else must be the same. Domains and ports of cells are replaced by ones that no other test holds."""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

FOLDERS = ("docs/tutorials", "docs/how-to")
MARK = re.compile(r"<!-- *(.*?) *-->$")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
ENDED_JOB = re.compile(r"(?m)^\[\d+\][-+ ] +\w+ .*\n")  # what the shell says of a job in the background
NUMBERS_MAY_DIFFER = 0.1  # of the larger one
LONGEST = 120  # s: a page that takes so long waits for something


class Block:
    def __init__(self, language, mark, text, line):
        self.language, self.mark, self.text, self.line = language, mark, text, line


def blocks(page):
    """The fenced blocks of a page, each with the comment on the line before it."""
    found, lines, mark, number = [], page.read_text(encoding="utf-8").splitlines(), "", 0
    while number < len(lines):
        line = lines[number]
        if line.startswith("```"):
            end = next((k for k in range(number + 1, len(lines)) if lines[k].startswith("```")), None)
            if end is None:
                raise SystemExit(f"{page}:{number + 1}: the block has no end; close it with ```")
            found.append(Block(line[3:].strip(), mark, "\n".join(lines[number + 1:end]) + "\n", number + 1))
            number = end
        comment = MARK.match(line)
        mark = comment.group(1) if comment else ""
        number += 1
    return found


def indented(page):
    """Lines of commands in indented blocks, which nobody would run: a fault of the page."""
    lines, fenced = page.read_text(encoding="utf-8").splitlines(), False
    for number, line in enumerate(lines):
        fenced ^= line.startswith("```")
        if not fenced and line.startswith("    ") and number and not lines[number - 1].strip():
            yield f"{page}:{number + 1}: an indented block is not run; put it between ``` lines"


def steps(page):
    """What the shell has to do: (kind, block, argument) with kind run, skip, file or output."""
    done = []
    for block in blocks(page):
        where = f"{page}:{block.line}"
        status, reason = re.fullmatch(r"status (\d+)", block.mark), re.fullmatch(r"not run: (.+)", block.mark)
        file = re.fullmatch(r"file ([\w./-]+)", block.mark)
        if file:
            done.append(("file", block, file.group(1)))
        elif block.language == "sh" and reason:
            done.append(("skip", block, reason.group(1)))
        elif block.language == "sh" and (status or not block.mark):
            done.append(("run", block, int(status.group(1)) if status else 0))
        elif block.language == "text" and not block.mark:
            if not any(kind == "run" for kind, _, _ in done):
                raise SystemExit(f"{where}: output without a command before it; mark it <!-- sketch -->")
            done.append(("output", block, None))
        elif block.mark not in ("", "sketch"):
            raise SystemExit(f"{where}: `{block.mark}` is no mark of a block; see tests/tutorials.py")
    return done


def same_line(expected, printed):
    """Whether two lines say the same: blanks count as one, numbers are compared loosely."""
    expected, printed = (" ".join(line.split()) for line in (expected, printed))
    if expected.endswith("..."):  # the rest of the line is free
        expected = expected[:-3].rstrip()
        printed = " ".join(printed.split(" ")[:len(expected.split(" "))])
    if NUMBER.sub("0", expected) != NUMBER.sub("0", printed):
        return False
    for a, b in zip(map(float, NUMBER.findall(expected)), map(float, NUMBER.findall(printed))):
        if abs(a - b) > NUMBERS_MAY_DIFFER * max(abs(a), abs(b)):
            return False
    return True


def same_text(expected, printed):
    """Whether the printed lines are those of the page, where `...` stands for any lines. (line of the page that is missing, or None)"""
    expected = [line for line in expected if line.strip()]
    printed = [line for line in printed if line.strip()]
    at, free = 0, False
    for line in expected:
        if line.strip() == "...":
            free = True
            continue
        hit = next((k for k in range(at, len(printed)) if same_line(line, printed[k])), None) if free else (
            at if at < len(printed) and same_line(line, printed[at]) else None)
        if hit is None:
            return line
        at, free = hit + 1, False
    return None if free or at == len(printed) else f"(no more lines, but there is: {printed[at]})"


def script_of(todo, outputs):
    """One shell script of all blocks; the output of block K goes to OUTPUTS/K."""
    lines = ["set -m -o pipefail"]  # jobs in the background may be ended by %1, as on a terminal
    for k, (kind, block, argument) in enumerate(todo):
        if kind == "file":
            lines += [f"mkdir -p \"$(dirname '{argument}')\" && cat >'{argument}' <<'END_OF_THE_FILE' || exit 99",
                      block.text.rstrip("\n"), "END_OF_THE_FILE"]
        elif kind == "run":
            last = [f"status=$?; set +e; echo {k} $status >'{outputs}/at'"]
            if argument:
                lines += ["set +e", "{", block.text, f"}} >'{outputs}/{k}' 2>&1"] + last
                lines += [f"[[ $status == {argument} ]] || exit 98"]
            else:  # `set -e` holds in a group that is no part of a condition
                lines += [f"echo {k} >'{outputs}/at'", "set -e", "{", block.text, f"}} >'{outputs}/{k}' 2>&1"] + last
    return "\n".join(lines) + "\nexit 0\n"


def end_session(leader):
    """Ends what the page left running: all processes of the shell's session."""
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                session = int(entry.joinpath("stat").read_text().rsplit(")", 1)[1].split()[3])
                if session == leader and int(entry.name) != leader:
                    os.kill(int(entry.name), signal.SIGKILL)
            except (OSError, IndexError, ValueError):
                pass  # it ended by itself


def run_script(script, folder, environment):
    shell = subprocess.Popen(["bash", "-c", script], cwd=folder, env=environment, start_new_session=True,
                             stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        said, _ = shell.communicate(timeout=LONGEST)
        return shell.returncode, said.decode(errors="replace")
    except subprocess.TimeoutExpired:
        shell.kill()
        return None, f"it took longer than {LONGEST} s"
    finally:
        end_session(shell.pid)


def run_page(page, folder, environment, change=lambda text: text, show=False):
    """Faults of a page, as lines; the shell begins in `folder`."""
    todo, bad = steps(page), list(indented(page))
    if bad:
        return bad
    if not any(kind == "run" for kind, _, _ in todo):
        return []
    outputs = pathlib.Path(tempfile.mkdtemp(dir=folder.parent))
    status, said = run_script(change(script_of(todo, outputs)), folder, environment)

    def text_of(k):
        file = outputs / str(k)
        said = file.read_text(errors="replace").replace(str(folder), "~") if file.exists() else ""
        return ENDED_JOB.sub("", said)
    for k, (kind, block, _) in enumerate(todo):
        if show and kind == "run":
            print(f"--- line {block.line}\n{block.text}--- prints\n{text_of(k)}")
    if status != 0:
        at = int((outputs / "at").read_text().split()[0]) if (outputs / "at").exists() else 0
        printed = "\n".join(text_of(at).splitlines()[-30:])
        block = todo[at][1]
        return [f"{page}:{block.line}: the block fails ({said.strip() or f'status {status}'}):\n{block.text}\nIt printed:\n{printed}"]
    faults, last = [], None
    for k, (kind, block, _) in enumerate(todo):
        if kind == "run":
            last = k
        if kind == "output":
            missing = same_text(change(block.text).splitlines(), text_of(last).splitlines())
            if missing is not None:
                faults.append(f"{page}:{block.line}: the output differs at:\n  {missing}\nThe commands printed:\n{text_of(last)}")
    return faults


def claim(name, first, step, count):
    """A number that no other test holds while this process lives (as tests/support/claims.sh does)."""
    import fcntl
    import random
    folder = pathlib.Path(os.environ.get("TMPDIR", "/tmp"), f"invar-test-claims-{os.getuid()}")
    folder.mkdir(exist_ok=True)
    numbers = list(range(first, first + step * count, step))
    random.shuffle(numbers)  # which one does not matter: the page is the same with each
    for number in numbers:
        lock = open(folder / f"{name}-{number}", "w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        claim.held.append(lock)
        return number
    raise SystemExit(f"all {count} numbers of {name} are held: see {folder}")


claim.held = []


def own_numbers():
    """A function that replaces domains and ports of cells by claimed ones."""
    domain, port = claim("domain", 101, 1, 99), claim("port", 20000, 10, 1000)

    def change(text):
        text = re.sub(r"(?m)^domain: \d+", f"domain: {domain}", text)
        text = re.sub(r"(--domain|\bplant|/position) \d+", rf"\1 {domain}", text)
        return re.sub(r"\b150([2-5])(\d)\b", lambda m: str(port + 2 * (int(m.group(1)) - 2) + int(m.group(2)) % 2), text)
    return change


def home_of_a_reader(build, source, folder, change):
    """~/invar is the installed package, with domains and ports of its own; `~/checkout` is the source with its build."""
    package = folder / "invar"
    shutil.copytree(build / "pages" / "share", package / "share")
    for part in (build / "pages").iterdir():
        if part.name != "share":
            (package / part.name).symlink_to(part)
    for file in package.rglob("share/**/*.yaml"):
        text = file.read_text(encoding="utf-8")
        if change(text) != text:
            file.write_text(change(text), encoding="utf-8")
    checkout = folder / "checkout"
    checkout.mkdir()
    for entry in source.iterdir():
        if entry.name not in ("build", ".git", "out"):
            (checkout / entry.name).symlink_to(entry)
    (checkout / "build").symlink_to(build)


def run(build, source, page, show=False):
    with tempfile.TemporaryDirectory(prefix="invar-page-") as place:
        folder = pathlib.Path(place).resolve() / "reader"
        folder.mkdir()
        change = own_numbers()
        home_of_a_reader(build, source, folder, change)
        environment = dict(os.environ, HOME=str(folder), COLUMNS="120", LC_ALL="C.UTF-8",
                           PATH=f"{folder}/invar/bin:{os.environ['PATH']}", INVAR_BUILD=str(build))
        if shutil.which("ccache"):  # a reader's first build is measured elsewhere
            environment.update(CMAKE_CXX_COMPILER_LAUNCHER="ccache", CMAKE_C_COMPILER_LAUNCHER="ccache", CCACHE_NOHASHDIR="1",
                               CCACHE_BASEDIR=str(folder), CCACHE_DIR=os.environ.get("CCACHE_DIR", os.path.expanduser("~/.cache/ccache")))
        return run_page(page, folder, environment, change, show)


def pages_of(source):
    return [page for folder in FOLDERS for page in sorted((source / folder).glob("*.md"))] + sorted(source.glob("examples/*/README.md"))


def install(build):
    shutil.rmtree(build / "pages", ignore_errors=True)
    subprocess.run(["cmake", "--install", build, "--prefix", build / "pages"], check=True, stdout=subprocess.DEVNULL)


def self_test():
    """Each kind of fault is found, and a sound page has none."""
    fence = "```"
    cases = {
        f"{fence}sh\necho 10.0 um\n{fence}\n{fence}text\n10.5   um\n{fence}\n": None,
        f"{fence}sh\necho 10.0 um\n{fence}\n{fence}text\n12 um\n{fence}\n": "the output differs",
        f"{fence}sh\necho one; echo two\n{fence}\n{fence}text\none\n{fence}\n": "no more lines",
        f"{fence}sh\necho one; echo two; echo 3\n{fence}\n{fence}text\n...\ntwo\n...\n{fence}\n": None,
        f"{fence}sh\necho one two 3\n{fence}\n{fence}text\none two ...\n{fence}\n": None,
        f"{fence}sh\necho one two 3\n{fence}\n{fence}text\none three ...\n{fence}\n": "the output differs",
        f"{fence}sh\nfalse\ntrue\n{fence}\n": "the block fails",
        f"{fence}sh\ncd /\nx=4\n{fence}\n{fence}sh\necho $PWD $x\n{fence}\n{fence}text\n/ 4\n{fence}\n": None,
        f"{fence}sh\nfalse | cat\n{fence}\n": "the block fails",
        f"<!-- status 2 -->\n{fence}sh\n(exit 2)\n{fence}\n": None,
        f"<!-- status 2 -->\n{fence}sh\ntrue\n{fence}\n": "the block fails",
        f"<!-- not run: needs root -->\n{fence}sh\nfalse\n{fence}\n": None,
        f"<!-- file a/b.txt -->\n{fence}yaml\nkey: $x\n{fence}\n{fence}sh\ncat a/b.txt\n{fence}\n{fence}text\nkey: $x\n{fence}\n": None,
        "text\n\n    false\n": "an indented block",
        f"<!-- sketch -->\n{fence}text\nnothing\n{fence}\n": None,
    }
    bad = []
    with tempfile.TemporaryDirectory() as place:
        for k, (text, wanted) in enumerate(cases.items()):
            folder = pathlib.Path(place) / str(k) / "reader"
            folder.mkdir(parents=True)
            page = folder.parent / "page.md"
            page.write_text(text)
            found = "\n".join(run_page(page, folder, dict(os.environ)))
            if (wanted is None) != (found == "") or (wanted or "") not in found:
                bad.append(f"self-test: {text!r} gives {found!r}, not {wanted!r}")
    return bad


def main(words):
    command, rest = words[0] if words else "", words[1:]
    if command == "self-test":
        faults = self_test()
    elif command == "install" and len(rest) == 2:
        faults = install(pathlib.Path(rest[0]).resolve()) or []
    elif command in ("run", "show") and len(rest) == 3:
        faults = run(*(pathlib.Path(word).resolve() for word in rest), show=command == "show")
    elif command == "list" and len(rest) == 1:
        source = pathlib.Path(rest[0]).resolve()
        for page in pages_of(source):
            for kind, block, reason in steps(page):
                if kind == "skip":
                    print(f"{page.relative_to(source)}:{block.line}: not run: {reason}")
        faults = []
    elif command == "complete" and rest:
        source = pathlib.Path(rest[0]).resolve()
        there, named = {str(page.relative_to(source)) for page in pages_of(source)}, set(rest[1:])
        faults = [f"{page}: is not among the pages of tests/pages.cmake" for page in sorted(there - named)]
        faults += [f"{page}: is named in tests/pages.cmake, but does not exist" for page in sorted(named - there)]
    else:
        print(__doc__)
        return 2
    print("\n".join(faults), end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
