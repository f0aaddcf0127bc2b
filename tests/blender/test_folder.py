#!/usr/bin/env python3
"""The folder of a bake, without Blender: whose it is, and what may be replaced in it (blender/drape_cloth/folder.py). Output is TAP."""
import itertools
import json
import os
import shutil
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import SOURCES, equal, run_tests, text_of, write_text  # pylint: disable=wrong-import-position

sys.path.insert(0, SOURCES + "/blender/drape_cloth")
from folder import FIRST_PART, MAX_NAME, RECORD, Folder, Owner, Problem, file_name, one_line  # pylint: disable=wrong-import-position

os.fsync = lambda fd: None  # the files need not survive a power failure

NAMES = ["Grid", "a\nb", 'q"\'', "$(touch x)`y`", "../up", "..", ".", "", "/etc/passwd", "a\\b", "\x1b[31mred", "a\0b", "ü" * 127 + "x", "ü" * 127 + "y", "/" * 255, "漢" * 85, "\udcff",
         "\ud800", "%2F", "a%0Ab", "~", "%s"]


def write(path, text="of the user\n"):
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    write_text(path, text)


def read(path):
    return text_of(path)


def tree(path="."):
    """What is below a folder: the bytes of files, where links lead, and the names of folders."""
    found = {}
    for folder, folders, names in os.walk(path):
        for name in folders + names:
            one = os.path.join(folder, name)
            found[one] = os.readlink(one) if os.path.islink(one) else read(one) if os.path.isfile(one) else None
    return found


def owner_of(file="a.blend", name="Grid", identity="", others=()):
    return Owner(os.path.abspath(file), name, identity, frozenset(others))


def bake(path="bake", owner=None, **files):
    """Writes these files as a bake does, and returns its id and what was set aside. Parts of names are separated by __ here."""
    files = {name.replace("__", "."): text for name, text in (files or {"scene__json": "scene", "cloth__obj": "cloth"}).items()}
    shutil.rmtree("made", ignore_errors=True)
    for name, text in files.items():
        write("made/" + name, text)
    with Folder(path, owner or owner_of()) as folder:
        folder.take()
        folder.fill("made", keep=("drape.log",))
        return folder.id, folder.aside


def refused(says, path="bake", owner=None):
    """A folder that is not ours stays as it is, and one line says why."""
    before = tree()
    try:
        with Folder(path, owner or owner_of()) as folder:
            folder.take()
    except Problem as problem:
        assert says in str(problem) and "another" in str(problem) and one_line(str(problem)) == str(problem), problem
        equal(tree(), before)
        return
    raise AssertionError("taken: " + says)


def test_names():
    """the name of any object gives a name for a file, which differs from that of any other; names of Blender are not cut"""
    made = [file_name(name) for name in NAMES]
    for name in made:
        assert "/" not in name and name.isprintable() and len(name.encode("utf-8")) <= MAX_NAME, name
        os.mkdir("drape_" + name)
    equal(len(set(made)), len(made))
    equal(sorted(os.listdir(".")), sorted("drape_" + name for name in made))
    for name in "Täch", "Cube.001", "a b-c_d":
        equal(file_name(name), name)
    equal(len(file_name("/" * 63)), 3 * 63)
    equal(one_line("a\nb \x1b[31m \udcff ü"), r"a\nb \x1b[31m \udcff ü")


def test_of_something_else():
    """a folder with files but without a record is refused, and so is a file, or a record that is a link or not sound"""
    for name in "scene.json", "cloth.obj", "collider_0.obj":
        write("bake/" + name)
    write("letter.txt")
    os.symlink("../letter.txt", "bake/drape.log")
    refused("Grid: the folder bake has files of something else, such as cloth.obj")
    refused("letter.txt is not a folder", "letter.txt")
    bake("sound")
    record = json.loads(read("sound/" + RECORD))
    shutil.copytree("sound", "linked")
    os.rename("linked/" + RECORD, "record")
    os.symlink("../record", "linked/" + RECORD)
    refused("is not the record of a bake", "linked")
    broken = [[], {}, {**record, "drape_bake": 2}, {**record, "id": 1}, {**record, "part": ""}, {**record, "part": "*" * 32}, {**record, "files": 1},
              {**record, "files": {"../letter.txt": []}}, {**record, "files": {"..": []}}, {**record, "files": {"a": 1}}]
    for text in ["", "{", "\u0663", *map(json.dumps, broken)]:
        write("sound/" + RECORD, text)
        refused("is not the record of a bake", "sound")
    os.mkdir("pipe")
    os.mkfifo("pipe/" + RECORD)
    try:
        Folder("pipe", owner_of())
        raise AssertionError("taken")
    except Problem as problem:
        assert "is not the record" in str(problem)


def test_nothing_before_take():
    """a folder that is looked at is not made, and an empty one may be taken"""
    with Folder("parent/bake", owner_of()) as folder:
        assert not folder.taken and not os.path.exists("parent")
    os.mkdir("empty")
    with Folder("empty", owner_of()) as folder:
        equal(os.listdir("empty"), [])
        folder.take()
        assert folder.taken and len(folder.id) == 32


def test_files():
    """a bake is that of its file: one beside it, and a copy under another name, are refused, until the original is gone; a file that moves keeps its bake"""
    write("p/a.blend")
    write("p/b.blend")
    known, _ = bake("p/bake", owner_of("p/a.blend"))
    equal(bake("p/bake", owner_of("p/a.blend", identity=known)), (known, []))
    equal(bake("p/bake", owner_of("p/a.blend"))[0], known)  # the file was not saved after the bake
    for identity in "", known, "other":
        refused("the folder p/bake has the bake of Grid of a.blend", "p/bake", owner_of("p/b.blend", identity=identity))
    shutil.copytree("p", "copy")  # with its own bake
    equal(bake("copy/bake", owner_of("copy/a.blend", identity=known), scene__json="of the copy")[0], known)
    equal(read("p/bake/scene.json"), "scene")
    os.rename("p", "moved")
    equal(bake("moved/bake", owner_of("moved/a.blend", identity=known))[0], known)
    equal(bake("moved/bake", owner_of("moved/a.blend"))[0], known)
    os.rename("moved/a.blend", "moved/c.blend")
    refused("has the bake of Grid of a.blend", "moved/bake", owner_of("moved/b.blend"))
    refused("has the bake of Grid of a.blend", "moved/bake", owner_of("moved/c.blend", identity="other"))
    equal(bake("moved/bake", owner_of("moved/c.blend", identity=known))[0], known)
    refused("has the bake of Grid of c.blend", "moved/bake", owner_of("moved/b.blend", identity=known))
    os.symlink("moved", "link")
    equal(bake("link/bake", owner_of("link/c.blend"))[0], known)
    os.symlink(os.path.abspath("moved/bake"), "disk")  # copies of a project share a folder that it links to
    refused("has the bake of Grid of c.blend", "disk", owner_of("copy/a.blend", identity=known))
    bake("unsaved", owner_of("tmp/unsaved_1"))
    refused("has the bake of Grid of unsaved_1", "unsaved", owner_of("tmp/unsaved_2"))
    bake("unsaved", owner_of("tmp/unsaved_1"))


def test_objects():
    """a bake is that of its object: one that is renamed keeps it; a copy, and another that gets the name, are refused"""
    write("a.blend")
    known, _ = bake()
    refused("has the bake of Grid of a.blend", owner=owner_of(name="Grid.001"))
    refused("has the bake of Grid of a.blend", owner=owner_of(name="Grid.001", identity=known, others=[known]))  # a copy
    refused("has the bake of Grid of a.blend", owner=owner_of(name="Grid", others=[known]))  # the other was called so
    refused("has the bake of Grid of a.blend", owner=owner_of(name="Grid", identity="other", others=[known]))
    equal(bake(owner=owner_of(identity=known, others=[known]))[0], known)  # that was copied
    equal(bake(owner=owner_of(name="Base", identity=known))[0], known)
    refused("has the bake of Base of a.blend")
    with Folder("bake", owner_of(name="Base", identity=known)) as folder:
        folder.take()
        folder.rename("Top")
    equal(bake(owner=owner_of(name="Top"))[0], known)
    equal(bake(owner=owner_of(name="Top", identity="own"))[0], "own")
    for number, name in enumerate(NAMES):
        known, _ = bake(f"names/{number}", owner_of(name=name))
        equal(bake(f"names/{number}", owner_of(name=name))[0], known)
        with Folder(f"names/{number}", owner_of(name=name, identity=known)):
            pass


def test_users_files():
    """files that a bake wrote are replaced and removed; those that were changed since, and others in their place, keep their bytes under another name"""
    write("a.blend")
    write("letter.txt")
    bake(scene__json="1", cloth__obj="2", render__obj="3", start__obj="4", a="5", b="6", c="7")
    write("bake/scene.json", "9")  # of the same size
    write("bake/render.obj", "mine")
    write("bake/collider_0.obj")
    os.mkdir("bake/collider_1.obj")
    os.remove("bake/a")
    os.symlink("../letter.txt", "bake/a")
    os.mkfifo("bake/collider_2.obj")
    os.remove("bake/b")
    os.link("letter.txt", "bake/b")
    os.link("bake/c", "copy_of_c")
    write("bake/note.txt")
    aside = ["a", "b", "collider_0.obj", "collider_1.obj", "collider_2.obj", "scene.json"]
    equal(bake(**{name.replace(".", "__"): "new" for name in aside}, c="new", cloth__obj="new")[1], [f"{name} is not as a bake left it: it is now {name}.changed" for name in aside])
    for name in *aside, "c", "cloth.obj":
        assert not os.path.islink("bake/" + name)
        equal(read("bake/" + name), "new")
    equal(sorted(os.listdir("bake")), sorted([*aside, *(name + ".changed" for name in aside), "c", "cloth.obj", "render.obj", "note.txt", RECORD]))  # start.obj is gone
    equal([read("bake/" + name) for name in ("scene.json.changed", "render.obj", "collider_0.obj.changed", "b.changed", "note.txt")],
          ["9", "mine", "of the user\n", "of the user\n", "of the user\n"])
    equal((read("letter.txt"), os.readlink("bake/a.changed"), read("copy_of_c")), ("of the user\n", "../letter.txt", "7"))
    write("bake/a", "mine")
    write("bake/c", "")
    equal(bake(a="2", render__obj="2")[1], ["a is not as a bake left it: it is now a.changed1", "render.obj is not as a bake left it: it is now render.obj.changed"])
    assert not os.path.exists("bake/cloth.obj") and read("bake/c") == "" and read("bake/a.changed1") == "mine"


def test_log():
    """a file that grows has a temporary name until it is published; a link in its place is not followed"""
    write("a.blend")
    write("letter.txt")
    bake()
    os.symlink("../letter.txt", "bake/drape.log")
    with Folder("bake", owner_of()) as folder:
        folder.take()
        with folder.part("drape.log") as file:
            file.write(b"printed\n")
            file.flush()
            folder.publish("drape.log")
        equal(folder.aside, ["drape.log is not as a bake left it: it is now drape.log.changed"])
    equal((read("letter.txt"), read("bake/drape.log"), os.readlink("bake/drape.log.changed")), ("of the user\n", "printed\n", "../letter.txt"))
    bake()
    equal(read("bake/drape.log"), "printed\n")  # stays until it is published anew


class Killed(BaseException):
    pass


def test_killed():
    """wherever a bake is killed, the next one knows the files that it left, and those of the user are there"""
    calls = [name for name in ("replace", "rename", "link", "unlink", "open", "fsync", "mkdir")]
    kept = {name: getattr(os, name) for name in calls}

    def counted(function):
        def call(*args, **options):
            nonlocal left
            left -= 1
            if left < 0:
                raise Killed
            return function(*args, **options)
        return call

    for changed in False, True:
        for count in itertools.count():
            shutil.rmtree("bake", ignore_errors=True)
            if changed:
                bake(scene__json="old", cloth__obj="old", gone="old")
                write("bake/cloth.obj", "mine")
            shutil.rmtree("made", ignore_errors=True)
            for name in "scene.json", "cloth.obj", "collider_0.obj":
                write("made/" + name, "new")
            left = count
            for name in calls:
                setattr(os, name, counted(kept[name]))
            try:
                with Folder("bake", owner_of()) as folder:
                    folder.take()
                    folder.fill("made", keep=())
            except Killed:
                pass
            finally:
                for name in calls:
                    setattr(os, name, kept[name])
            bake(scene__json="again", cloth__obj="again")
            names = {name for name in os.listdir("bake") if not FIRST_PART.fullmatch(name)}
            aside = {name for name in names if name.startswith("cloth.obj.changed")}  # two if it was killed while the file had both names
            equal(names - aside, {"scene.json", "cloth.obj", RECORD}, str(count))
            equal({read("bake/" + name) for name in aside}, {"mine"} if changed else set(), str(count))
            if left >= 0:
                assert count > 15, count
                break


def test_meanwhile():
    """a file that somebody writes while a bake is about to is not replaced; two bakes do not write at the same time"""
    write("a.blend")
    with Folder("bake", owner_of()) as folder:
        folder.take()
        refused("another bake is writing into the folder bake")
        with folder.part("scene.json") as file:
            file.write(b"new")
        save = folder._save

        def meanwhile():
            save()
            write("bake/scene.json")
        folder._save = meanwhile
        try:
            folder.publish("scene.json")
            raise AssertionError("published")
        except FileExistsError:
            pass
    equal(read("bake/scene.json"), "of the user\n")
    equal(bake(scene__json="new")[1], ["scene.json is not as a bake left it: it is now scene.json.changed"])


sys.exit(run_tests(globals()))
