"""The processes of a cell that `invar run` has started."""
import pathlib


def children(launcher):
    """Process name in the cell -> process id, of the `invar run` with this id; none where it is gone."""
    found = {}
    try:
        pids = pathlib.Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split()
    except OSError:
        return found
    for child in pids:
        try:
            words = pathlib.Path(f"/proc/{child}/cmdline").read_text().split("\0")
        except OSError:
            continue
        if "--process" in words:
            found[words[words.index("--process") + 1]] = int(child)
    return found
