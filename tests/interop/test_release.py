"""The parts of release/make, which itself is run by tests/nightly."""

import os
import shutil
import subprocess
import tarfile

import fmpy

from conftest import ROOT, binary, for_windows


def run(script, *arguments, check=True):
    words = [str(ROOT / "release" / script), *map(str, arguments)]
    return subprocess.run(words, cwd=ROOT, check=check, capture_output=True, text=True)


def test_an_archive_depends_on_its_files_alone(tmp_path):
    first, second = tmp_path / "a" / "name", tmp_path / "b" / "name"
    (first / "docs").mkdir(parents=True)
    (first / "docs" / "page.md").write_text("text")
    (first / "program").write_text("#!/bin/sh\n")
    (first / "program").chmod(0o700)
    shutil.copytree(first, second)
    (second / "program").chmod(0o775)
    (second / "docs" / "page.md").chmod(0o664)
    for path in [second, *second.rglob("*")]:
        os.utime(path, (1, 1e9))
    archives = [tmp_path / "1.tar.gz", tmp_path / "2.tar.gz"]
    for archive, folder in zip(archives, [first, second]):
        run("pack", archive, folder)
    assert archives[0].read_bytes() == archives[1].read_bytes()
    with tarfile.open(archives[0]) as archive:
        entries = archive.getmembers()
    assert [entry.name for entry in entries] == ["name", "name/docs", "name/docs/page.md", "name/program"]
    assert [entry.mode for entry in entries] == [0o755, 0o755, 0o644, 0o755]
    assert {(entry.uid, entry.gid, entry.uname, entry.mtime) for entry in entries} == {(0, 0, "", 315532800)}


def test_licences_are_those_of_what_is_linked():
    printed = run("licences").stdout
    listed = printed.partition("=" * 80)[0].splitlines()
    crates = {line.split()[0] for line in listed if ": " in line}
    assert {"clarabel", "nalgebra", "parquet", "toml", "zip"} <= crates
    # Tests, benches, build scripts and our own crates are not included.
    assert not crates & {"criterion", "proptest", "cc", "punctual-core"}
    for words in ["Permission is hereby granted, free of charge", "Apache License", "Mozilla Public License"]:
        assert words in printed
    assert "clarabel 0" in printed.partition("=" * 80)[2]


def test_folders_of_several_systems_are_joined(demo, tmp_path):
    linux, windows, out = (tmp_path / name for name in ["linux", "windows", "out"])
    for folder in [linux, windows]:
        (folder / "models").mkdir(parents=True)
    shutil.copy(demo[0] / "point_mass-plant.fmu", linux / "models" / "plant.fmu")
    for_windows(linux / "models" / "plant.fmu", windows / "models" / "plant.fmu")
    run("join", binary(), out, linux, windows)
    joined = [path.relative_to(out).as_posix() for path in out.rglob("*.fmu")]
    assert joined == ["models/plant.fmu"]
    assert sorted(fmpy.supported_platforms(out / joined[0])) == ["linux64", "win64"]
    shutil.copy(linux / "models" / "plant.fmu", linux / "another.fmu")
    done = run("join", binary(), out, linux, windows, check=False)
    assert done.returncode == 1 and "have FMUs of other names" in done.stderr
