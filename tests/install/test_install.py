#!/usr/bin/env python3
"""test_install.py: the installed tree, as a host uses it. Runs `meson install` into a temporary folder; checks the files and the exported symbols;
builds the hosts of examples/ against it with pkg-config, with CMake and against the static library, and runs the Python host. Output is TAP. Tests
that need a program that is not installed, or a library that this build does not make, are skipped."""
import os
import re
import shutil
import subprocess
import sys
import tempfile

SOURCE, BUILD = os.environ["DRAPE_SOURCE"], os.environ["DRAPE_BUILD"]
PREFIX, LIBDIR = sys.argv[1:3]
EXAMPLES = os.path.join(SOURCE, "examples")
FRAMES = "45"


os.environ["CMAKE_GENERATOR"] = "Ninja"  # the program that builds Drape: a bare system has no make


class Skip(Exception):
    pass


def run(*command, cwd=None, env=None):
    done = subprocess.run(command, cwd=cwd, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300)
    assert done.returncode == 0, f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}"
    return done.stdout


def need(name):
    path = shutil.which(name)
    if not path:
        raise Skip(f"no {name}")
    return path


class Tree:
    """An installed tree below `top`; `install` fills it."""

    def __init__(self, top):
        self.top, self.prefix = top, top + PREFIX
        self.lib, self.work = os.path.join(self.prefix, LIBDIR), top + ".work"
        os.makedirs(self.work)
        run(need("meson"), "install", "-C", BUILD, "--no-rebuild", "--quiet", "--destdir", top)
        pkgconfig = os.path.join(self.lib, "pkgconfig")
        self.env = {**os.environ, "PKG_CONFIG_SYSROOT_DIR": top, "PKG_CONFIG_LIBDIR": pkgconfig, "LD_LIBRARY_PATH": self.lib}

    def shared(self):
        path = os.path.join(self.lib, "libdrape.so")
        if not os.path.exists(path):
            raise Skip("this build has no shared library")
        return path

    def static(self):
        path = os.path.join(self.lib, "libdrape.a")
        if not os.path.exists(path):
            raise Skip("this build has no static library")
        return path

    def flags(self, *options, package="drape"):
        return run(need("pkg-config"), *options, package, env=self.env).split()


def declared():
    """The functions that the public headers of the library declare."""
    names = set()
    for header in ("drape.h", "extend.h"):
        with open(os.path.join(SOURCE, "include", "drape", header)) as file:
            text = re.sub(r"/\*.*?\*/", "", file.read(), flags=re.S)
        names |= set(re.findall(r"^DRAPE_API [^;(]*?\b(drape_\w+)\(", text, flags=re.M))
    return names


def symbols(path, *options):
    lines = run(need("nm"), *options, "--defined-only", path).splitlines()
    return {parts[2].split("@")[0] for parts in map(str.split, lines) if len(parts) == 3 and parts[1] not in "A"}


def what_is_installed(tree):
    for name in ("include/drape/drape.h", "include/drape/extend.h", "include/drape/export.h", "bin/drape", "share/drape/blender/drape_cloth.zip"):
        assert os.path.isfile(os.path.join(tree.prefix, name)), name
    for name in ("pkgconfig/drape.pc", "cmake/drape/drape-config.cmake", "cmake/drape/drape-config-version.cmake"):
        assert os.path.isfile(os.path.join(tree.lib, name)), name
    pages = {name for _, _, names in os.walk(os.path.join(tree.prefix, "share", "man")) for name in names}
    assert {"drape.1", "drape-run.1", "drape-scene.5", "drape.3"} <= pages, pages
    library = tree.shared()
    assert os.readlink(library) == "libdrape.so.1" and "." in os.readlink(library + ".1")
    assert "SONAME" in run("objdump", "-p", library) and "libdrape.so.1" in run("objdump", "-p", library)


def what_the_shared_library_shows(tree):
    shown = symbols(tree.shared(), "-D")
    assert shown == declared(), f"shown and not declared: {sorted(shown - declared())}; declared and not shown: {sorted(declared() - shown)}"
    assert all(name.startswith("drape_") for name in shown) and len(shown) > 70


def what_the_static_library_defines(tree):
    defined = symbols(tree.static(), "-g")
    assert declared() <= defined
    defined -= {"__wrap_SUNRpowerR", "__wrap_malloc", "__wrap_calloc"}  # the linker demands these names: src/meson.build
    assert all(name.startswith("drape_") for name in defined), sorted(name for name in defined if not name.startswith("drape_"))


def what_of_libm_the_static_library_calls(tree):
    """Only functions that IEEE 754 or their definition leave one result: base/elementary.h has the others."""
    libm = run(need("cc"), "-print-file-name=libm.so.6").strip()
    undefined = {line.split()[-1] for line in run(need("nm"), "-u", tree.static()).splitlines() if line.split()[:1] == ["U"]}
    called = undefined & symbols(libm, "-D")
    exact = {"ceil", "copysign", "fabs", "floor", "fmax", "fmaxf", "fmin", "fminf", "fmod", "frexp", "ldexp", "lround", "nextafterf", "rint", "round", "sqrt", "trunc"}
    assert called <= exact and "fmod" in called, sorted(called)


def what_comes_along(tree):
    needed = re.findall(r"NEEDED +(\S+)", run("objdump", "-p", tree.shared()))
    others = ["libgsl", "libpetsc", "libmpi", "libepoxy", "libGL"]
    if "--wrap" in " ".join(tree.flags("--static", "--libs")):  # SUNDIALS and SuiteSparse are archives: they are inside
        others += ["libsundials", "libklu", "libbtf", "libamd", "libcolamd", "libsuitesparse"]
    for name in others:
        assert not any(library.startswith(name) for library in needed), needed
    libraries = tree.flags("--libs")
    assert "-ldrape" in libraries and not any("sundials" in flag or "klu" in flag for flag in libraries), libraries


# Of SuiteSparse, what docs/licences.md names, and its prefixes; and what is under the GPL, as most of SuiteSparse's other parts are.
INSIDE = {"KLU": r"klu_", "BTF": r"btf_", "AMD": r"amd_", "COLAMD": r"colamd", "SuiteSparse's configuration": r"SuiteSparse_"}
NEVER = r"_*(cholmod_|umf_|umfpack|spqr|SuiteSparseQR|camd_|ccolamd|csymamd|gsl_|mongoose)"


def what_the_library_contains(tree):
    """What the page of licences says of SuiteSparse is what the linker took, local symbols included; nothing under the GPL."""
    with open(os.path.join(SOURCE, "docs", "licences.md"), encoding="utf-8") as file:
        page = file.read()
    archives = "--wrap" in " ".join(tree.flags("--static", "--libs"))
    for path in tree.shared(), tree.static():
        names = symbols(path)
        assert not [name for name in names if re.match(NEVER, name)], path
        found = {part for part, prefix in INSIDE.items() if any(re.match("_*" + prefix, name) for name in names)}
        if path.endswith(".so"):
            assert found == (set(INSIDE) if archives else set()), (path, found)
    assert all(part in page for part in INSIDE), page


def check_host(output):
    lines = output.splitlines()
    assert len(lines) == int(FRAMES) // 30 and lines[0].startswith("t "), output


def host_in_c(tree):
    tree.shared()
    source, program = os.path.join(EXAMPLES, "host_c", "host.c"), os.path.join(tree.work, "host_c")
    with open(source) as file:
        assert sum(1 for _ in file) < 60
    run(need("cc"), "-Wall", "-Werror", source, *tree.flags("--cflags", "--libs"), "-lm", "-o", program)
    assert "libdrape.so.1" in run("ldd", program, env=tree.env)
    check_host(run(program, FRAMES, env=tree.env))


def body_in_c(tree):
    """A body that hangs from cloth: at the end it is pulled up with its weight, within what is left of its swing."""
    source, program = os.path.join(EXAMPLES, "host_c", "body.c"), os.path.join(tree.work, "body_c")
    run(need("cc"), "-Wall", "-Werror", source, *tree.flags("--cflags", "--libs"), "-lm", "-o", program)
    lines = run(program, "300", env=tree.env).splitlines()
    weight = float(re.search(r"with ([-0-9.]+) of its weight", lines[-1]).group(1))
    assert len(lines) == 10 and 0.9 < weight < 1.1, lines


def host_in_c_static(tree):
    """By drape-static, with and without --static, and by what drape lists for it; the shared library is beside."""
    source, program = os.path.join(EXAMPLES, "host_c", "host.c"), os.path.join(tree.work, "host_c_static")
    listed = [tree.static() if flag == "-ldrape" else flag for flag in tree.flags("--static", "--cflags", "--libs")]
    for flags in (tree.flags("--cflags", "--libs", package="drape-static"), tree.flags("--static", "--cflags", "--libs", package="drape-static"), listed):
        run(need("cc"), source, *flags, "-lm", "-o", program)
        assert "libdrape" not in run("ldd", program) and "sundials" not in run("ldd", program)
        assert {"__wrap_SUNRpowerR", "drape_pow"} <= symbols(program)  # IDA and KINSOL call our powers
    check_host(run(program, FRAMES))


# A host with functions of its own under the names of SuiteSparse and SUNDIALS, as one with other versions of them has, which is put before them.
CLASHING = r"""
#include <drape/drape.h>
#include <stdio.h>
#include <stdlib.h>
static const char text[] = "{\"drape\": 1, \"cloth\": [{\"mesh\": {\"grid\": \"square\", \"columns\": 6, \"rows\": 6, \"width\": 1, \"height\": 1},"
    "\"material\": {\"young_modulus\": 1e4, \"thickness\": 1e-3, \"density\": 200}, \"terms\": [\"stretch.edge\"], \"pins\": [{\"edge\": \"top\"}]}],"
    "\"integrator\": {\"linear_solver\": \"klu\"}, \"duration\": 1}";
#define OURS(name) void name(void) { fprintf(stderr, #name " of the host was called\n"), exit(1); }
NAMES
int main(void)
{
    static const char *const methods[] = {"be", "ida", "dirk"};
    drape_context *ctx = NULL;
    drape_scene *scene = NULL;
    drape_status status = drape_context_create(NULL, &ctx);
    if (!status) status = drape_scene_parse(ctx, text, "text", &scene);
    for (int i = 0; !status && i < 3; i++) {
        drape_model *model = NULL;
        drape_sim *sim = NULL;
        status = drape_scene_set(scene, "/integrator/method", methods[i]);
        if (!status) status = drape_scene_compile(scene, &model);
        if (!status) status = drape_sim_create(ctx, model, NULL, &sim);
        if (!status) status = drape_sim_advance(sim, 0.1);
        drape_sim_destroy(&sim), drape_model_destroy(&model);
    }
    puts(status ? drape_context_message(ctx) : "it runs");
    drape_scene_destroy(&scene), drape_context_destroy(&ctx);
    return status != DRAPE_OK;
}
"""
CLASHES = ("klu_l_analyze", "klu_l_factor", "klu_l_refactor", "klu_l_solve", "klu_l_defaults", "klu_l_rcond", "btf_l_order", "amd_order", "amd_l_order", "amd_l2",
           "colamd_l", "SuiteSparse_malloc", "SuiteSparse_free", "SuiteSparse_config", "KINCreate", "KINSol", "IDACreate", "IDASolve", "CVode", "CVodeCreate",
           "ARKStepCreate", "ARKStepEvolve", "N_VNew_Serial", "N_VClone", "N_VDestroy", "SUNContext_Create", "SUNRpowerR", "SUNMatDestroy")


def host_with_libraries_of_its_own(tree):
    if "libklu" in run("objdump", "-p", tree.shared()):
        raise Skip("this build links SuiteSparse as shared libraries, which are the host's to choose")
    source, program = os.path.join(tree.work, "clash.c"), os.path.join(tree.work, "clash")
    with open(source, "w") as file:
        file.write(CLASHING.replace("NAMES", "\n".join(f"OURS({name})" for name in CLASHES)))
    run(need("cc"), source, "-rdynamic", *tree.flags("--cflags", "--libs"), "-o", program)
    assert set(CLASHES) <= symbols(program, "-D")
    assert run(program, env=tree.env) == "it runs\n"


LAB = r"""
#include <drape/lab.h>
#include <stdio.h>
int main(void)
{
    drape_context *ctx = NULL;
    drape_lab_def def;
    drape_lab_outcome outcome = {0};
    drape_lab_def_init(&def, sizeof def);
    if (drape_context_create(NULL, &ctx)) return 1;
    def.scene = "nowhere.json", def.folder = "out";
    const drape_status status = drape_lab_run(ctx, "tradeoff", &def, &outcome);
    puts(drape_context_message(ctx));
    drape_lab_outcome_free(&outcome);
    drape_context_destroy(&ctx);
    return status != DRAPE_E_FILE;
}
"""


def the_lab_links(tree):
    """By drape-lab alone, which brings the static library along."""
    tree.static()
    if not os.path.exists(os.path.join(tree.lib, "libdrape_lab.a")):
        raise Skip("this build has no experiments")
    source, program = os.path.join(tree.work, "lab.c"), os.path.join(tree.work, "lab")
    with open(source, "w") as file:
        file.write(LAB)
    for options in ((), ("--static",)):
        run(need("cc"), source, *tree.flags("--cflags", "--libs", *options, package="drape-lab"), "-o", program)
    assert "nowhere.json" in run(program, cwd=tree.work)
    assert "GPL" in run(need("pkg-config"), "--variable=licence", "drape-lab", env=tree.env)
    assert "GPL-3" not in run(need("pkg-config"), "--variable=licence", "drape", env=tree.env)


def documentation_is_installed(tree):
    """Pages with their pictures, the licence and the notices of what is inside; every link holds."""
    folder = os.path.join(tree.prefix, "share", "doc", "drape")
    for name in ("LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "docs/embedding.md", "licences/third-party.txt", "licences/LGPL-2.1.txt", "licences/GPL-3.txt"):
        assert os.path.getsize(os.path.join(folder, name)) > 0, name
    assert {name for name in os.listdir(os.path.join(SOURCE, "docs")) if name.endswith(".md")} <= set(os.listdir(os.path.join(folder, "docs")))
    assert not os.path.exists(os.path.join(folder, "docs", "make"))
    with open(os.path.join(folder, "licences", "third-party.txt")) as file:
        notices = file.read()
    for name in ("KINSOL", "ARKODE", "KLU and BTF", "AMD, COLAMD", "jansson", "GNU Scientific Library"):
        assert name in notices, name
    count = 0
    for at, _, names in os.walk(folder):
        for name in names:
            if name.endswith(".md"):
                with open(os.path.join(at, name), encoding="utf-8") as file:
                    links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", re.sub(r"```.*?```|`[^`]*`", "", file.read(), flags=re.S))
                count += len(links)
                for link in links:
                    assert os.path.exists(os.path.join(at, link)), f"{name}: {link}"
    assert count > 100, count


def host_in_cpp(tree):
    build = os.path.join(tree.work, "host_cpp")
    need("c++")
    run(need("cmake"), "-S", os.path.join(EXAMPLES, "host_cpp"), "-B", build, "-DCMAKE_PREFIX_PATH=" + tree.prefix,
        "-DCMAKE_CXX_FLAGS=-Wall -Wextra -Werror")
    run("cmake", "--build", build)
    check_host(run(os.path.join(build, "host"), FRAMES, env=tree.env))


def cmake_of_the_static_library(tree):
    tree.static()
    need("c++")
    project = os.path.join(tree.work, "static")
    shutil.copytree(os.path.join(EXAMPLES, "host_cpp"), project)
    with open(os.path.join(project, "CMakeLists.txt")) as file:
        text = file.read()
    with open(os.path.join(project, "CMakeLists.txt"), "w") as file:
        file.write(text.replace("drape::drape", "drape::static"))
    run(need("cmake"), "-S", project, "-B", project + "/build", "-DCMAKE_PREFIX_PATH=" + tree.prefix)
    run("cmake", "--build", project + "/build")
    assert "libdrape" not in run("ldd", project + "/build/host")
    check_host(run(project + "/build/host", FRAMES))


def cmake_refuses_another_version(tree):
    project = os.path.join(tree.work, "newer")
    os.makedirs(project)
    with open(os.path.join(project, "CMakeLists.txt"), "w") as file:
        file.write("cmake_minimum_required(VERSION 3.16)\nproject(newer C)\nfind_package(drape 99 QUIET)\n"
                   "if(drape_FOUND)\n  message(FATAL_ERROR \"taken\")\nendif()\nfind_package(drape 0.1 REQUIRED)\n")
    run(need("cmake"), "-S", project, "-B", project + "/build", "-DCMAKE_PREFIX_PATH=" + tree.prefix)


def host_in_python(tree):
    tree.shared()
    if subprocess.run(["/usr/bin/python3", "-c", "import numpy"], stderr=subprocess.DEVNULL).returncode:
        raise Skip("no numpy")
    # The package of the build folder finds the installed library as any program does.
    environment = {**tree.env, "PYTHONPATH": os.path.join(BUILD, "python")}
    check_host(run("/usr/bin/python3", "-B", os.path.join(EXAMPLES, "python", "realtime.py"), FRAMES, env=environment))


def the_program_runs(tree):
    output = run(os.path.join(tree.prefix, "bin", "drape"), "list", "terms")
    assert "stretch.edge" in output


TESTS = [what_is_installed, what_the_shared_library_shows, what_the_static_library_defines,
         what_of_libm_the_static_library_calls, what_comes_along, what_the_library_contains, host_in_c, body_in_c, host_in_c_static,
         host_with_libraries_of_its_own, the_lab_links, documentation_is_installed, host_in_cpp,
         cmake_of_the_static_library, cmake_refuses_another_version, host_in_python, the_program_runs]


def main():
    failed = 0
    print(f"1..{len(TESTS)}")
    with tempfile.TemporaryDirectory() as folder:
        tree = Tree(os.path.join(folder, "tree"))
        for number, test in enumerate(TESTS, 1):
            try:
                test(tree)
                print(f"ok {number} - {test.__name__}", flush=True)
            except Skip as reason:
                print(f"ok {number} - {test.__name__} # SKIP {reason}", flush=True)
            except Exception as error:
                failed += 1
                print("".join(f"# {line}\n" for line in str(error).splitlines()) + f"not ok {number} - {test.__name__}", flush=True)
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
