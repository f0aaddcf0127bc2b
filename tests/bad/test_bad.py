#!/usr/bin/env python3
"""Wrong scenes and meshes: each ends `drape run` with exit code 2 and one line that says where and what; nothing is
written. The lines are in expected.txt: scene, tab, line; <*> stands for any text (lists of names grow). --update prints
the present lines, to be read before they are kept. Output is TAP."""
import os
import re
import resource
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
CONTROL = 'good.json'  # as in the wrong scenes, but correct
LIMIT = 1 << 30  # bytes: a mesh that is too large is refused before it is allocated
PLACE = re.compile(r'^[\w.]+\.json(:\d+:\d+)?: ')


def program():
    return os.path.join(os.path.abspath(os.environ['DRAPE_BUILD']), 'drape')


def limit_memory():
    """Limits the memory, except with the address sanitizer, which reserves terabytes."""
    with open(program(), 'rb') as file:
        sanitized = b'__asan_init' in file.read()
    return None if sanitized else lambda: resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))


def run(scene, limit):
    """Exit code, stdout, stderr, and the files that were written."""
    with tempfile.TemporaryDirectory() as folder:
        command = [program(), 'run', scene, '--out', os.path.join(folder, 'out'),
                   '--summary', os.path.join(folder, 'summary.json')]
        result = subprocess.run(command, cwd=HERE, stdin=subprocess.DEVNULL, capture_output=True, timeout=60,
                                preexec_fn=limit)
        return (result.returncode, result.stdout.decode(), result.stderr.decode('utf-8', 'backslashreplace'),
                sorted(os.listdir(folder)))


def read_table():
    with open(os.path.join(HERE, 'expected.txt'), encoding='utf-8') as file:
        return dict(line.rstrip('\n').split('\t', 1) for line in file if line.strip() and not line.startswith('#'))


def matches(line, expected):
    return re.fullmatch('.*'.join(re.escape(part) for part in expected.split('<*>')), line) is not None


def faults(scene, expected, limit):
    code, out, err, written = run(scene, limit)
    if code != 2:
        yield f'exit code {code}'
    if out:
        yield f'standard output: {out!r}'
    if written:
        yield f'written: {written}'
    if err.count('\n') != 1 or not err.endswith('\n'):
        yield f'not one line: {err!r}'
    if not PLACE.match(err):
        yield f'no place: {err!r}'
    if expected is None:
        yield f'not in expected.txt: {err!r}'
    elif not matches(err.rstrip('\n'), expected):
        yield f'it says      {err!r}'
        yield f'it should    {expected!r}'


def check_control(limit):
    code, out, err, written = run(CONTROL, limit)
    if code != 0 or err or not out or written != ['out', 'summary.json']:
        yield f'exit code {code}, {err!r}, written: {written}'


def check_files(scenes, table):
    """Every line has a scene, and every mesh is named by a scene."""
    for name in sorted(set(table) - set(scenes)):
        yield f'{name} is in expected.txt, and not there'
    texts = [open(os.path.join(HERE, s), 'rb').read() for s in scenes + [CONTROL]]
    for name in sorted(os.listdir(HERE)):
        if name.endswith(('.obj', '.ply')) and not any(f'"{name}"'.encode() in text for text in texts):
            yield f'no scene names {name}'


def update(scenes, limit):
    for scene in scenes:
        print(scene, run(scene, limit)[2].rstrip('\n'), sep='\t')


def main():
    scenes = sorted(name for name in os.listdir(HERE) if name.endswith('.json') and name != CONTROL)
    limit = limit_memory()
    if '--update' in sys.argv:
        return update(scenes, limit)
    table = read_table()
    tests = [('control', check_control(limit)), ('files', check_files(scenes, table))]
    tests += [(scene, faults(scene, table.get(scene), limit)) for scene in scenes]
    failed = 0
    print(f'1..{len(tests)}')
    for number, (name, found) in enumerate(tests, 1):
        found = list(found)
        failed += bool(found)
        print(f'{"not " if found else ""}ok {number} - {name}')
        for text in found:
            print(f'# {text}')
    return failed > 0


sys.exit(main())
