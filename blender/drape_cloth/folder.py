"""The folder of a bake: the cloth that it belongs to, and the files in it that the add-on wrote. Nothing here needs Blender.

The rule is that of the program (src/io/folder.h): only files that were written by it are replaced and removed. The folder has a record, bake.json: the owner, and size and checksum of each
file. A file is ours if its name is in the record and its bytes are those that the record describes; all else is the user's, and is set aside under another name if a bake needs its own.
A file is written under a temporary name with the random number of the record, and is in the record before it gets its own name, so that a killed process leaves no file that the record
does not have. Links in the folder are not followed. The folder is locked while it is open, so a lock ends with its process.
"""
import contextlib
import errno
import fcntl
import hashlib
import itertools
import json
import os
import re
import shutil
import stat
import uuid
from typing import Any, BinaryIO, Collection, Dict, FrozenSet, List, NamedTuple, Optional

RECORD = "bake.json"
"""the record in the folder of a bake"""
FORMAT = 1
"""version of the record"""
FIRST_PART = re.compile(re.escape(RECORD) + r"\.[0-9a-f]{32}\.part")
"""what a process leaves that is killed before it gives a folder its record"""
MAX_NAME = 200
"""bytes of a name for files: file systems have 255, of which a few are for what is put before and behind it"""


class Problem(Exception):
    """What keeps a cloth from being baked, in words for the user."""


class Owner(NamedTuple):
    """A cloth that is baked."""
    file: str  # path of the .blend file; of one that was never saved, the folder of its bakes
    name: str  # of the object
    id: str = ""  # random; copies of the object and of the file have the same; empty: it was not baked yet, or not saved after that
    others: FrozenSet[str] = frozenset()  # ids of the other objects of the file


def one_line(text: str) -> str:
    """The text with its control characters as escapes, since names of objects may have them."""
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)


def file_name(name: str) -> str:
    """A name for files: other characters than letters, digits, and - . _ and space are written as in addresses, and a long name ends with its checksum, so that different
    names remain so."""
    made = re.sub(r"[^\w. -]", lambda sign: "".join(f"%{byte:02X}" for byte in sign.group().encode("utf-8", "surrogatepass")), name)
    if len(made.encode("utf-8")) <= MAX_NAME:
        return made
    end = "~" + hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:16]
    return made.encode("utf-8")[:MAX_NAME - len(end)].decode("utf-8", "ignore") + end


class Folder:
    """The folder at a path, which need not exist yet. Raises a Problem if it belongs to something else than this cloth; nothing is written before `take`."""

    def __init__(self, path: str, owner: Owner):
        self.path, self.owner = path, owner
        self.aside: List[str] = []  # what happened to files of the user
        self._fd = -1
        self._record: Optional[Dict[str, Any]] = None
        if os.path.lexists(path):
            self._enter()

    def __enter__(self) -> "Folder":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    # ---- Whose it is ----

    def _enter(self) -> None:
        """Opens and locks the folder, and reads the record."""
        try:
            self._fd = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        except NotADirectoryError as error:
            raise Problem(f"{self.owner.name}: {self.path} is not a folder: name another one in Folder") from error
        try:
            self._lock()
            names = os.listdir(self._fd)
            if RECORD in names:
                self._record = self._read()
                self._check_owner(self._record)
            elif foreign := [name for name in names if not FIRST_PART.fullmatch(name)]:
                raise Problem(f"{self.owner.name}: the folder {self.path} has files of something else, such as {min(foreign)}: name another one in Folder")
        except BaseException:
            self.close()
            raise

    def _lock(self) -> None:
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise Problem(f"{self.owner.name}: another bake is writing into the folder {self.path}: wait for its end, or name another one in Folder") from error
        except OSError:
            pass  # some network file systems have no locks

    def _read(self) -> Dict[str, Any]:
        try:
            with open(self._open(RECORD), encoding="ascii") as file:
                record = json.load(file)
            sound = record["drape_bake"] == FORMAT and all(isinstance(record[key], str) for key in ("id", "file", "object")) \
                and re.fullmatch("[0-9a-f]{32}", record["part"]) and all("/" not in name and name not in ("", ".", "..") and isinstance(known, list) for name, known in record["files"].items())
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            sound = False
        if not sound:
            raise Problem(f"{self.owner.name}: {os.path.join(self.path, RECORD)} is not the record of a bake: name another folder in Folder")
        return record

    def _check_owner(self, record: Dict[str, Any]) -> None:
        """A cloth finds its bake again by its id when its file was moved or renamed with or without the folder, or the object was renamed. Not so a copy, of a file whose
        original is still there, or of an object: the bake is that of the original. An id that was not saved is replaced by the names of file and object."""
        owner, recorded = self.owner, os.path.realpath(os.path.join(self.path, record["file"]))
        here, known, shared = recorded == os.path.realpath(owner.file), owner.id == record["id"], record["id"] in owner.others
        other_file = not here and os.path.isfile(recorded)
        is_owner = known or here and not shared if owner.name == record["object"] else known and not shared
        if other_file or not is_owner:
            raise Problem(f"{self.owner.name}: the folder {self.path} has the bake of {record['object']} of {os.path.basename(recorded)}: name another one in Folder")

    @property
    def taken(self) -> bool:
        """Whether it has a bake, or had one."""
        return self._record is not None

    @property
    def id(self) -> str:
        """That of the owner, once the folder is taken."""
        return self._record["id"]

    def take(self) -> None:
        """Makes the folder that of the owner, and removes what a killed process left."""
        if self._fd < 0:
            os.makedirs(self.path, exist_ok=True)
            self._enter()
        if self._record is None:
            self._record = {"drape_bake": FORMAT, "id": "", "file": "", "object": "", "part": uuid.uuid4().hex, "files": {}}
        self._record.update(id=self.owner.id or self._record["id"] or uuid.uuid4().hex,
                            file=os.path.relpath(os.path.realpath(self.owner.file), os.path.realpath(self.path)))
        for name in os.listdir(self._fd):
            if name.endswith(self._part("")):
                os.unlink(name, dir_fd=self._fd)
        self.rename(self.owner.name)

    def rename(self, name: str) -> None:
        """The owner is called so now."""
        self._record["object"] = name
        self._save()

    # ---- What is in it ----

    def _part(self, name: str) -> str:
        """The temporary name of a file."""
        return f"{name}.{self._record['part']}.part"

    def _open(self, name: str) -> int:
        """A descriptor to read a regular file."""
        fd = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=self._fd)
        if not stat.S_ISREG(os.fstat(fd).st_mode):
            os.close(fd)
            raise OSError(errno.EINVAL, "not a regular file", name)
        return fd

    def _describe(self, name: str) -> Dict[str, Any]:
        with open(self._open(name), "rb") as file:
            total = hashlib.sha256()
            for data in iter(lambda: file.read(1 << 20), b""):
                total.update(data)
            return {"size": file.tell(), "sha256": total.hexdigest()}

    def _stat(self, name: str) -> Optional[os.stat_result]:
        """Of a file or link, None if there is none."""
        try:
            return os.stat(name, dir_fd=self._fd, follow_symlinks=False)
        except FileNotFoundError:
            return None

    def _ours(self, name: str) -> bool:
        try:
            return self._describe(name) in self._record["files"].get(name, ())
        except OSError:
            return False

    def _save(self) -> None:
        with self.part(RECORD) as file:
            file.write((json.dumps(self._record, indent=1) + "\n").encode("ascii"))
            file.flush()
            os.fsync(file.fileno())
        os.replace(self._part(RECORD), RECORD, src_dir_fd=self._fd, dst_dir_fd=self._fd)

    def _rename(self, old: str, new: str) -> None:
        """Renames what is no link to something else, and replaces nothing."""
        at = {"src_dir_fd": self._fd, "dst_dir_fd": self._fd}
        try:
            os.link(old, new, follow_symlinks=False, **at)
            os.unlink(old, dir_fd=self._fd)
        except OSError as error:  # it is there; or this is a folder, or a file system without hard links
            if self._stat(new):
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), new) from error
            os.rename(old, new, **at)

    def is_directory(self, name: str) -> Optional[bool]:
        """Whether there is a folder of this name, and no link to one; None: there is nothing."""
        found = self._stat(name)
        return stat.S_ISDIR(found.st_mode) if found else None

    def part(self, name: str) -> BinaryIO:
        """A new file under a temporary name, to be written and published."""
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self._part(name), dir_fd=self._fd)
        return open(os.open(self._part(name), os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666, dir_fd=self._fd), "w+b")

    def set_aside(self, name: str) -> None:
        """Gives a file of the user another name."""
        for number in itertools.count():
            kept = f"{name}.changed{number or ''}"
            with contextlib.suppress(FileExistsError):
                self._rename(name, kept)
                break
        self.aside.append(f"{name} is not as a bake left it: it is now {os.path.basename(kept)}")

    def publish(self, *names: str) -> None:
        """Gives files that were written as parts their names. What is there is replaced if it is ours, else set aside."""
        files, replaced = self._record["files"], []
        made = {name: self._describe(self._part(name)) for name in names}
        for name in names:
            if self._ours(name):
                replaced.append(name)
            elif self._stat(name):
                self.set_aside(name)
        files.update({name: [*files.get(name, ()), made[name]] for name in names})
        self._save()
        for name in names:
            if name in replaced:
                os.replace(self._part(name), name, src_dir_fd=self._fd, dst_dir_fd=self._fd)
            else:
                self._rename(self._part(name), name)
        files.update({name: [made[name]] for name in names})
        self._save()

    def fill(self, made: str, keep: Collection[str]) -> None:
        """Publishes copies of the files of another folder, and removes all others that are ours but those to keep."""
        names = sorted(os.listdir(made))
        for name in names:
            with open(os.path.join(made, name), "rb") as source, self.part(name) as file:
                shutil.copyfileobj(source, file)
        self.publish(*names)
        files = self._record["files"]
        for name in set(files) - set(names) - set(keep):
            if self._ours(name):
                os.unlink(name, dir_fd=self._fd)
            del files[name]
        self._save()
