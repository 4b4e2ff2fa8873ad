"""The gate for code of the repository: choices, events, checkouts."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from copy import copy
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from action import environment
from sim_action.core import permissions
from sim_action.core.errors import UsageError
from tests.soak import examples

ALLOWED = ["push", "pull_request", "schedule", "merge_group", "release", "workflow_dispatch", "repository_dispatch", ""]
"""Events that need the right to write, or that have the rights of a fork; and no workflow at all."""

LEAST = {
    *("pull_request_target", "workflow_run", "issue_comment", "issues", "discussion", "discussion_comment"),
    *("fork", "watch", "gollum", "check_run", "check_suite", "status", "deployment", "deployment_status"),
}


def test_the_table_names_each_event_once() -> None:
    assert sum(map(len, permissions.PRIVILEGED_BY_REASON.values())) == len(permissions.PRIVILEGED_EVENTS)
    assert permissions.PRIVILEGED_EVENTS >= LEAST
    assert not permissions.PRIVILEGED_EVENTS & set(ALLOWED)


def test_nothing_is_cached_on_the_same_events() -> None:
    assert environment.NEVER_CACHED_ON == permissions.PRIVILEGED_EVENTS


@pytest.mark.parametrize("event", ALLOWED)
def test_code_runs_where_only_the_rights_of_its_author_are_at_stake(event: str, tmp_path: Path) -> None:
    assert permissions.scripts_refused("auto", {"GITHUB_EVENT_NAME": event}, [tmp_path]) is None


@pytest.mark.parametrize("event", sorted(permissions.PRIVILEGED_EVENTS))
def test_code_is_refused_where_strangers_would_have_the_rights_of_the_base_branch(event: str) -> None:
    refusal = permissions.scripts_refused("auto", {"GITHUB_EVENT_NAME": event})
    assert refusal is not None
    assert event in refusal
    assert "allow-scripts" in refusal
    assert "\n" not in refusal


def test_the_caller_decides_and_code_runs_on_a_machine_of_ones_own(tmp_path: Path) -> None:
    privileged, here = {"GITHUB_EVENT_NAME": "pull_request_target"}, pull_request(tmp_path)
    assert permissions.scripts_refused("true", privileged, [here]) is None
    assert permissions.scripts_refused("auto", {}, [here]) is None
    assert permissions.scripts_refused("false", {"GITHUB_EVENT_NAME": "push"}) is not None
    assert permissions.scripts_refused("false", {}) is not None


@pytest.mark.parametrize("event", [*ALLOWED, "pull_request_review", "an event to come"])
def test_a_pull_request_is_only_trusted_on_its_own_event(event: str, tmp_path: Path) -> None:
    refusal = permissions.scripts_refused("auto", {"GITHUB_EVENT_NAME": event}, [pull_request(tmp_path)])
    if event in ("", "pull_request"):
        assert refusal is None
        return
    assert refusal is not None
    assert "refs/remotes/pull/7/merge" in refusal
    assert event in refusal
    assert "allow-scripts to true" in refusal
    assert "\n" not in refusal


def test_refusals_name_their_subject_and_variables_are_sorted() -> None:
    permissions.Permissions().require_scripts("rostest")
    with pytest.raises(UsageError, match=r"^rostest: no$"):
        permissions.Permissions(scripts_refused="no").require_scripts("rostest")
    assert permissions.checked_names(["B", "A_1", "B"]) == ("A_1", "B")


@pytest.mark.parametrize("name", ["", "A=B", "1A", "A*", "A B", "A\nB", "Ä"])
def test_anything_else_is_no_name_of_a_variable(name: str) -> None:
    with pytest.raises(UsageError, match="--pass-env takes the name"):
        permissions.checked_names([name])


def pull_request(folder: Path) -> Path:
    """A checkout of a pull request."""
    ref = folder / ".git/refs/remotes/pull/7/merge"
    ref.parent.mkdir(parents=True)
    ref.write_text("1" * 40 + "\n")
    return folder


OWN, OTHER = "1" * 40, "2" * 40
PUSH: Mapping[str, str] = {
    "GITHUB_EVENT_NAME": "push",
    "GITHUB_REPOSITORY": "owner/robot",
    "GITHUB_REPOSITORY_OWNER": "owner",
    "GITHUB_SHA": OWN,
    "GITHUB_REF": "refs/heads/main",
}
CONFIG = (
    '[core]\n\tbare = false\n[remote "upstream"]\n\turl = x\n[remote "origin"]\n\turl = {}\n\tfetch = +refs\n[gc]\n'
)


def repository(root: Path, head: str = OWN, **files: str) -> Path:
    """A checkout of a commit of the repository; `files`: contents of files of `.git`, with `__` for a slash."""
    git = root / ".git"
    git.mkdir(parents=True)
    every = {"HEAD": f"{head}\n", "config": CONFIG.format("https://github.com/owner/robot"), **files}
    if "ref:" not in head:
        every.setdefault("refs__remotes__origin__main", head)
    for name, text in every.items():
        path = git / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="")
    return root


def sign(folder: Path, **variables: str) -> str | None:
    return permissions.foreign_checkout({**PUSH, **variables}, [folder])


def test_no_checkout_and_a_branch_of_ones_own_have_no_sign(tmp_path: Path) -> None:
    assert sign(tmp_path) is None
    assert permissions.foreign_checkout({}, []) is None
    fetched = f"{OWN}\t\tbranch 'main' of https://github.com/owner/robot\n"
    here = repository(tmp_path, "ref: refs/heads/main", refs__heads__main=OWN, FETCH_HEAD=fetched)
    assert sign(here) is None
    assert sign(tmp_path / "deep/below") is None


@pytest.mark.parametrize(
    ("files", "named"),
    [
        ({"refs__remotes__pull__7__merge": OTHER}, "refs/remotes/pull/7/merge"),
        ({"refs__remotes__pull__7__head": OTHER}, "refs/remotes/pull/7/head"),
        ({"refs__remotes__origin__pull__7__head": OTHER}, "refs/remotes/origin/pull/7/head"),
        ({"refs__pull__7__head": OTHER}, "refs/pull/7/head"),
        ({"packed-refs": f"# pack-refs\n{OWN} refs/heads/main\n{OTHER} refs/remotes/pull/7/merge\n"}, "pull/7/merge"),
        ({"FETCH_HEAD": f"{OTHER}\t\t'refs/pull/7/head' of https://github.com/owner/robot\n"}, "refs/pull/7/"),
        ({"config": CONFIG.format("x") + '[branch "try"]\n\tmerge = refs/pull/7/head\n'}, "a branch in its configur"),
    ],
)
def test_a_pull_request_leaves_a_sign(files: dict[str, str], named: str, tmp_path: Path) -> None:
    found = sign(repository(tmp_path, OTHER, **files))
    assert found is not None
    assert "pull request" in found
    assert named in found


def test_refs_of_earlier_jobs_mean_nothing_unless_they_name_the_commit_here(tmp_path: Path) -> None:
    """A self-hosted runner keeps them. The commit of a tag, or one that the job has made, is not that of the event."""
    here = repository(tmp_path / "a", OWN, refs__remotes__pull__7__merge=OTHER)
    assert sign(here) is None
    assert sign(here, GITHUB_SHA="3" * 40, GITHUB_EVENT_NAME="workflow_dispatch") is None
    assert sign(here, GITHUB_SHA="") is None
    there = repository(tmp_path / "b", OTHER, refs__remotes__pull__7__merge=OTHER)
    assert sign(there) is not None
    assert sign(there, GITHUB_SHA="") is not None
    assert sign(there, GITHUB_SHA=OTHER) is None
    assert sign(repository(tmp_path / "c", "unknown", refs__remotes__pull__7__merge=OTHER)) is not None
    assert sign(repository(tmp_path / "d", OWN, refs__remotes__pull__7__merge="ref: x"), GITHUB_SHA=OTHER) is not None


def moved(*moves: tuple[str, str, str]) -> str:
    """The log of HEAD."""
    return "".join(f"{old} {new} bot <b@c> 1700000000 +0000\t{message}\n" for old, new, message in moves)


def test_commits_on_top_of_a_pull_request_are_of_it(tmp_path: Path) -> None:
    refs = {"refs__remotes__pull__7__merge": OTHER}
    top, next_top, first = "3" * 40, "4" * 40, "0" * 40
    checked_out = (first, OTHER, "checkout: moving from main to refs/remotes/pull/7/merge")
    built = (checked_out, (OTHER, top, "commit: checkout: x"))
    for name, head, moves in (
        ("commit", top, built),
        ("branch", top, (*built, (top, top, "checkout: moving from 3333333 to fix"))),
        ("two", next_top, (*built, (top, next_top, "commit: y"))),
        ("reset", next_top, (checked_out, (OTHER, next_top, "reset: moving to main"))),
    ):
        assert "pull/7/merge" in (sign(repository(tmp_path / name, head, logs__HEAD=moved(*moves), **refs)) or "")
    left = (*built, (top, OWN, "checkout: moving from 3333333 to main"), (OWN, next_top, "commit: z"))
    assert sign(repository(tmp_path / "left", next_top, logs__HEAD=moved(*left), **refs)) is None


OF_PULL = f"{OTHER}\tnot-for-merge\t'refs/pull/7/head' of https://github.com/owner/robot\n"
OF_UPSTREAM = f"{OTHER}\t\tbranch 'main' of https://github.com/stranger/robot\n"
FOLLOWS_PULL = CONFIG.format("x") + '[branch "main"]\n\tmerge = refs/pull/7/head\n'


@pytest.mark.parametrize("files", [{"FETCH_HEAD": OF_PULL}, {"FETCH_HEAD": OF_UPSTREAM}, {"config": FOLLOWS_PULL}])
def test_fetches_mean_nothing_at_the_commit_of_the_event(files: dict[str, str], tmp_path: Path) -> None:
    """Tools fetch pull requests for a changelog, or the repository of which this is a fork."""
    here = repository(tmp_path, "ref: refs/heads/main", refs__heads__main=OWN, **files)
    assert sign(here) is None
    assert sign(here, GITHUB_SHA=OTHER) is not None
    assert sign(here, GITHUB_SHA="") is not None
    for merge in ("MERGE_HEAD", "SQUASH_MSG", "CHERRY_PICK_HEAD"):
        (here / ".git" / merge).write_text(OTHER)
        assert sign(here) is not None, merge
        (here / ".git" / merge).unlink()


EVIL = "https://github.com/evil/repo"


@pytest.mark.parametrize("branch", ["x", "a]b", 'a"b', "a#b", "a;b", "deep/ü", "a\u00a0", "a\u2028b", "a\x85b", "X.y"])
def test_the_branch_of_a_fork_is_a_sign_while_it_is_checked_out(branch: str, tmp_path: Path) -> None:
    """As `gh pr checkout` configures it, for an address or the name of a remote."""
    quoted = branch.replace('"', '\\"')
    ok = CONFIG.format("https://github.com/owner/robot")
    section = f'[branch "{quoted}"]\n\tremote = {{}}\n\tmerge = refs/heads/x\n'
    named = f'[remote "fork"]\n\turl = {EVIL}\n'
    for number, config in enumerate((ok + section.format(EVIL), ok + named + section.format("fork"))):
        here = repository(tmp_path / str(number), f"ref: refs/heads/{branch}", config=config)
        assert "is of a repository of 'evil'" in (sign(here) or "")
        (here / ".git/HEAD").write_text("ref: refs/heads/main\n")
        for ref in ("heads/main", "remotes/origin/main"):
            (here / ".git/refs" / ref).parent.mkdir(parents=True, exist_ok=True)
            (here / ".git/refs" / ref).write_text(OTHER)
        assert sign(here) is None
        (here / ".git/HEAD").write_text(f"{OTHER}\n")
        assert sign(here) is None
    packed = f"{OTHER} refs/heads/{branch}\n{OTHER} refs/remotes/origin/main\n"
    config = ok + section.format("origin")
    own = repository(tmp_path / "own", f"ref: refs/heads/{branch}", config=config, **{"packed-refs": packed})
    assert sign(own) is None


@pytest.mark.parametrize(
    "config",
    [
        f"[remote.origin]\n\turl = {EVIL}\n",
        f"[Remote.Origin]\n\tURL = {EVIL}\n",
        f'[REMOTE "origin"]\r\n\tUrl={EVIL}\r\n',
        f'[remote "origin"] url = {EVIL}\n',
        f'[remote "origin"]\n\tpushurl = https://github.com/owner/robot\n\turl = "{EVIL}" # x\n',
        f'[remote "origin"]\n# [core]\n; url = x\n\turl = {EVIL} ; x\n',
        '[remote "origin"]\n\turl = https://github.com/\\\nevil/repo\n',
        f'[core]\n\tx = "[\n[remote "origin"]\n\tfetch = +refs\n[gc]\n[remote "origin"]\n\turl = {EVIL}\n',
    ],
)
def test_every_form_of_the_configuration_is_read(config: str, tmp_path: Path) -> None:
    assert "is of a repository of 'evil'" in (sign(repository(tmp_path / "evil", config=config)) or "")


def test_what_git_does_not_fetch_from_is_no_sign(tmp_path: Path) -> None:
    owner = "url = https://github.com/owner/robot\n\t"
    for lines in (f"pushurl = {EVIL}", f"{owner}url = {EVIL}", f"#\turl = {EVIL}"):
        assert sign(repository(tmp_path / str(len(lines)), config=f'[remote "origin"]\n\t{lines}\n')) is None
    assert sign(repository(tmp_path, config=f'[remote "Origin"]\n\turl = {EVIL}\n')) is None


@pytest.mark.parametrize(
    ("address", "server", "counts"),
    [
        ("https://mirror.corp/cache/repo", "https://github.com", False),
        ("git@mirror.corp:cache/repo.git", "https://github.com", False),
        ("https://mirror.corp/cache/repo", "https://ghe.corp", False),
        ("https://ghe.corp/evil/repo", "https://ghe.corp", True),
        ("https://GHE.corp:8443/git/evil/repo", "https://ghe.corp/", True),
        ("git@ghe.corp:evil/repo", "https://ghe.corp:8443", True),
        ("https://github.com/evil/repo", "https://ghe.corp", True),
        ("https://github.com./evil/repo", "https://github.com", True),
        ("https://gist.github.com/evil/1", "https://github.com", True),
        ("https://gitlab.com/evil/repo", "https://github.com", True),
        ("https://github.com/evil/repo", "", True),
        ("https://[/evil/repo", "https://github.com", False),
        ("https://github.com/evil/repo", "https://[", True),
    ],
)
def test_owners_count_on_the_jobs_and_public_servers(address: str, server: str, counts: bool, tmp_path: Path) -> None:
    here = repository(tmp_path, config=CONFIG.format(address))
    assert (sign(here, GITHUB_SERVER_URL=server) is not None) is counts


def test_a_branch_is_followed_to_its_commit(tmp_path: Path) -> None:
    refs = {"refs__remotes__pull__7__merge": OTHER}
    loose = repository(tmp_path / "a", "ref: refs/heads/main", refs__heads__main=OWN, **refs)
    packed = {"packed-refs": f"{OWN} refs/heads/main\n^{OTHER}\n"}
    assert sign(loose) is None
    assert sign(repository(tmp_path / "b", "ref: refs/heads/main", **refs, **packed)) is None
    assert sign(repository(tmp_path / "c", "ref: ../../x", **refs)) is not None


@pytest.mark.parametrize(
    "address",
    [
        *("https://github.com/stranger/robot", "https://token@github.com/stranger/robot.git/"),
        *(
            "git@github.com:stranger/robot.git",
            "ssh://git@ssh.github.com:443/stranger/robot",
            "github.com:stranger/robot",
        ),
    ],
)
def test_another_owner_is_a_stranger(address: str, tmp_path: Path) -> None:
    for name, files in (
        ("origin", {"config": CONFIG.format(address)}),
        ("fetched", {"FETCH_HEAD": f"{OWN}\t\t{address}\n"}),
        ("branch", {"FETCH_HEAD": f"{OWN}\tnot-for-merge\tbranch 'x of y' of {address}\n"}),
    ):
        found = sign(repository(tmp_path / name, OWN if name == "origin" else OTHER, **files))
        assert found is not None, name
        assert "is of a repository of 'stranger', not of 'owner'" in found
        assert sign(tmp_path / name, GITHUB_REPOSITORY_OWNER="Stranger") is None or name != "origin"


@pytest.mark.parametrize(
    "address", ["https://github.com/Owner/robot", "git@github.com:owner/other.git", "/srv/robot", "../robot", "x", ""]
)
def test_the_same_owner_and_paths_are_no_strangers(address: str, tmp_path: Path) -> None:
    assert sign(repository(tmp_path, config=CONFIG.format(address))) is None


def test_the_owner_is_also_known_from_the_repository(tmp_path: Path) -> None:
    here = repository(tmp_path, config=CONFIG.format("https://github.com/stranger/robot"))
    assert sign(here, GITHUB_REPOSITORY_OWNER="") is not None
    assert sign(here, GITHUB_REPOSITORY_OWNER="", GITHUB_REPOSITORY="") is None


def test_a_workflow_for_a_pull_request_is_refused_without_a_checkout() -> None:
    assert "refs/pull/7/merge" in (permissions.foreign_checkout({**PUSH, "GITHUB_REF": "refs/pull/7/merge"}, []) or "")


def test_another_commit_than_that_of_a_dispatch_may_be_anything(tmp_path: Path) -> None:
    here = repository(tmp_path, OTHER)
    assert sign(here) is None
    assert "may be of a pull request" in (sign(here, GITHUB_EVENT_NAME="repository_dispatch") or "")
    assert sign(here, GITHUB_EVENT_NAME="repository_dispatch", GITHUB_SHA=OTHER) is None


def test_checkouts_below_the_workspace_count_for_pull_requests_and_not_for_owners(tmp_path: Path) -> None:
    repository(tmp_path)
    workspace = {"GITHUB_WORKSPACE": str(tmp_path)}
    repository(tmp_path / "src/messages", config=CONFIG.format("https://github.com/stranger/messages"))
    assert sign(tmp_path, **workspace) is None
    assert sign(tmp_path / "src/messages", **workspace) is not None
    repository(tmp_path / "src/pull", OTHER, refs__remotes__pull__7__merge=OTHER)
    assert "src/pull" in (sign(tmp_path, **workspace) or "")


@pytest.mark.process
def test_a_worktree_is_read_through_its_file(tmp_path: Path) -> None:
    git("init", "-q", "-b", "main", folder=tmp_path)
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "--allow-empty", "-m", "x", folder=tmp_path)
    git("worktree", "add", "-q", "tree", folder=tmp_path)
    commit = git("rev-parse", "HEAD", folder=tmp_path)
    assert (tmp_path / "tree/.git").is_file()
    assert sign(tmp_path / "tree") is None
    git("update-ref", "refs/remotes/pull/7/merge", commit, folder=tmp_path)
    assert "tree" in (sign(tmp_path / "tree") or "")
    assert sign(tmp_path / "tree", GITHUB_SHA=commit) is None
    git("pack-refs", "--all", folder=tmp_path)
    assert sign(tmp_path / "tree") is not None


def test_a_submodule_has_the_commit_that_its_parent_says(tmp_path: Path) -> None:
    parent, module = repository(tmp_path), tmp_path / "robots/spot"
    inner = parent / ".git/modules/robots/spot"
    inner.mkdir(parents=True)
    (inner / "config").write_text(CONFIG.format("https://github.com/stranger/spot"))
    (inner / "HEAD").write_text(OTHER)
    module.mkdir(parents=True)
    (module / ".git").write_text("gitdir: ../../.git/modules/robots/spot\n")
    assert sign(module) is None
    (inner / "FETCH_HEAD").write_text(f"{OTHER}\t\t'refs/pull/7/head' of https://github.com/stranger/spot\n")
    assert "robots/spot" in (sign(module) or "")


@pytest.mark.process
@example("HEAD", b"\0")
@example("FETCH_HEAD", b"1\t\thttps://[x/y/z")
@example("config", b'[branch "x"]\nremote')
@examples(50)
@given(st.sampled_from(["HEAD", "FETCH_HEAD", "config", "packed-refs", "commondir", "logs"]), st.binary(max_size=200))
def test_any_content_of_files_is_read(name: str, content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        read_all(Path(folder), name, content)


def read_all(folder: Path, name: str, content: bytes) -> None:
    (folder / ".git/logs").mkdir(parents=True)
    (folder / ".git" / ("logs/HEAD" if name == "logs" else name)).write_bytes(content)
    sign(folder)
    link = folder / "link"
    link.mkdir()
    (link / ".git").write_bytes(b"gitdir: " + content)
    sign(link)


class Origin:
    """A repository with a branch, a tag and the pull request of a stranger, and a clone of a job in `here`."""

    def __init__(self, folder: Path) -> None:
        self.there, self.here = folder / "there", folder / "here"
        self.there.mkdir()
        git("init", "-q", "-b", "main", folder=self.there)
        self.base = commit(self.there, "base")
        git("checkout", "-q", "-b", "develop", folder=self.there)
        self.older, self.develop = commit(self.there, "older"), commit(self.there, "develop")
        git("tag", "-m", "v1", "v1", folder=self.there)
        git("checkout", "-q", "--detach", self.base, folder=self.there)
        self.pull = commit(self.there, "pull")
        git("update-ref", "refs/pull/7/head", self.pull, folder=self.there)
        git("checkout", "-q", "main", folder=self.there)
        git("clone", "-q", str(self.there), str(self.here), folder=folder)

    def sign(self, folder: str = ".", **variables: str) -> str | None:
        event = {"GITHUB_SHA": self.base, "GITHUB_WORKSPACE": str(self.here), **variables}
        return sign(self.here / folder, **event)

    def do(self, *commands: str) -> None:
        for command in commands:
            words = command.format(there=self.there, pull=self.pull, older=self.older, base=self.base).split()
            identity = ("-c", "user.name=a", "-c", "user.email=a@b", "-c", "protocol.file.allow=always")
            folder = self.here / words.pop(0) if words[0] in ("pr", "sub") else self.here
            git(*identity, *words, folder=folder)


@pytest.fixture(scope="module")
def first_origin(tmp_path_factory: pytest.TempPathFactory) -> Origin:
    return Origin(tmp_path_factory.mktemp("origin"))


@pytest.fixture
def origin(first_origin: Origin, tmp_path: Path) -> Origin:
    copied = copy(first_origin)
    copied.here = tmp_path / "here"
    shutil.copytree(first_origin.here, copied.here, symlinks=True)
    return copied


def commit(folder: Path, name: str) -> str:
    (folder / name).write_text(name)
    git("add", ".", folder=folder)
    git("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-q", "-m", name, folder=folder)
    return git("rev-parse", "HEAD", folder=folder)


FETCH, LATER = "fetch -q origin refs/pull/7/head", "fetch -q origin main"


@pytest.mark.process
@pytest.mark.parametrize(
    ("commands", "folder"),
    [
        ([FETCH, "checkout -q FETCH_HEAD"], "."),
        ([FETCH, "checkout -q FETCH_HEAD", LATER], "."),
        ([FETCH, "checkout -q {pull}", LATER], "."),
        ([FETCH, "checkout -q -b mine FETCH_HEAD", LATER], "."),
        ([FETCH, "reset -q --hard FETCH_HEAD", LATER], "."),
        ([FETCH, "merge -q FETCH_HEAD", LATER], "."),
        ([FETCH, "commit -q --allow-empty -m x", "merge -q --no-ff -m y FETCH_HEAD", LATER], "."),
        ([FETCH, "commit -q --allow-empty -m x", "merge -q --no-ff --no-commit FETCH_HEAD", LATER], "."),
        ([FETCH, "commit -q --allow-empty -m x", "merge -q --squash FETCH_HEAD", LATER], "."),
        ([FETCH, "checkout -q FETCH_HEAD", "commit -q --allow-empty -m x", LATER], "."),
        ([FETCH, "commit -q --allow-empty -m x", "cherry-pick {pull}", LATER], "."),
        ([FETCH, "checkout -q FETCH_HEAD", "rebase -q origin/develop", LATER], "."),
        ([FETCH, "worktree add -q --detach pr FETCH_HEAD"], "pr"),
        ([FETCH, "worktree add -q --detach pr FETCH_HEAD"], "."),
        ([FETCH, "worktree add -q --detach pr FETCH_HEAD", LATER], "pr"),
        ([FETCH, "worktree add -q -b mine pr FETCH_HEAD", LATER], "pr"),
        ([FETCH, "worktree add -q --detach pr FETCH_HEAD", LATER, "pr commit -q --allow-empty -m x"], "pr"),
        (["worktree add -q --detach pr", "pr " + FETCH, "checkout -q {pull}"], "."),
        (["fetch -q origin refs/pull/7/head:refs/heads/mine", "checkout -q mine", LATER], "."),
        (["fetch -q origin refs/pull/7/head:refs/remotes/origin/mine", "checkout -q origin/mine", LATER], "."),
        (["fetch -q origin pull/7/head:refs/remotes/origin/mine", "checkout -q origin/mine", LATER], "."),
        (["fetch -q origin {pull}:refs/remotes/origin/mine", "checkout -q origin/mine", LATER], "."),
        (["fetch -q origin refs/pull/7/head:refs/tags/mine", "checkout -q mine", LATER], "."),
        (
            [
                "config --add remote.origin.fetch +refs/pull/*/head:refs/remotes/origin/pr/*",
                *("fetch -q", "checkout -q origin/pr/7", "pack-refs --all", LATER),
            ],
            ".",
        ),
        (["remote add other {there}", "fetch -q other refs/pull/7/head", "checkout -q FETCH_HEAD", LATER], "."),
        (["fetch -q {there} refs/pull/7/head", "worktree add -q --detach pr FETCH_HEAD", LATER], "pr"),
        (["clone -q {there} pr", "pr " + FETCH, "pr checkout -q {pull}", "pr " + LATER], "pr"),
        (["clone -q {there} pr", "pr " + FETCH, "pr checkout -q {pull}", "pr " + LATER], "."),
        (["init -q pr", "pr fetch -q {there} refs/pull/7/head", "pr checkout -q FETCH_HEAD"], "pr"),
        (["init -q pr"], "pr"),
    ],
)
def test_a_pull_request_is_refused_however_it_came(commands: list[str], folder: str, origin: Origin) -> None:
    origin.do(*commands)
    assert "of a pull request" in (origin.sign(folder) or "")
    assert "of a pull request" in (origin.sign(folder, GITHUB_EVENT_NAME="workflow_dispatch", GITHUB_SHA="") or "")


@pytest.mark.process
def test_a_pull_request_from_another_remote_is_refused(origin: Origin) -> None:
    """The address of the remote has another owner; so the names of its branches and tags say nothing."""
    origin.do("remote add fork {there}", "fetch -q fork +refs/pull/7/head:refs/remotes/fork/main", "checkout -q {pull}")
    origin.do("update-ref refs/tags/mine {pull}", "remote set-url fork https://github.com/stranger/robot")
    (origin.here / ".git/FETCH_HEAD").unlink()
    (origin.here / ".git/logs/refs/remotes/fork/main").unlink()
    assert "may be of a pull request" in (origin.sign() or "")


@pytest.mark.process
@pytest.mark.parametrize(
    ("commands", "folder"),
    [
        ([], "."),
        ([FETCH], "."),
        (["checkout -q develop"], "."),
        (["checkout -q origin/develop", FETCH, LATER], "."),
        (["checkout -q v1"], "."),
        (["checkout -q {older}"], "."),
        (["fetch -q origin develop", "checkout -q FETCH_HEAD"], "."),
        (
            ["tag -d v1", "branch -rd origin/develop", "fetch -q origin refs/tags/v1:refs/tags/v1", "checkout -q v1"],
            ".",
        ),
        (["commit -q --allow-empty -m x", "commit -q --amend -m y --allow-empty"], "."),
        (["checkout -q develop", "commit -q --allow-empty -m x", "revert --no-edit {older}"], "."),
        (["commit -q --allow-empty -m x", "merge -q --no-ff -m y origin/develop"], "."),
        (["checkout -q -b release", "commit -q --allow-empty -m x", "pack-refs --all"], "."),
        (["worktree add -q --detach pr origin/develop"], "pr"),
        (["worktree add -q --detach pr", "pr commit -q --allow-empty -m x"], "pr"),
        (["submodule add -q {there} sub"], "sub"),
        (["clone -q {there} pr", "pr checkout -q {older}"], "pr"),
    ],
)
def test_commits_of_the_repository_and_of_the_job_are_known(commands: list[str], folder: str, origin: Origin) -> None:
    origin.do(*commands)
    assert origin.sign(folder) is None


@pytest.mark.process
def test_a_shallow_checkout_knows_the_commit_of_the_event(origin: Origin, tmp_path: Path) -> None:
    git("clone", "-q", "--depth=1", f"file://{origin.there}", str(tmp_path / "shallow"), folder=tmp_path)
    origin.here = tmp_path / "shallow"
    origin.do("commit -q --allow-empty -m x")
    assert origin.sign() is None
    assert origin.sign(GITHUB_SHA=OTHER) is None
    origin.do("fetch -q --depth=1 origin refs/pull/7/head", "checkout -q {pull}", LATER)
    assert "of a pull request" in (origin.sign() or "")


def test_without_git_only_refs_are_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    here = repository(tmp_path, OTHER)
    assert sign(here) is None
    (here / ".git/refs/remotes/origin/main").write_text(OWN)
    assert "may be of a pull request: 2222222" in (sign(here) or "")


def test_a_dependency_may_be_at_any_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workflows pin it. A second checkout of the repository itself is none, whatever its address looks like."""
    monkeypatch.setenv("PATH", "")
    repository(tmp_path)
    config = "https://github.com/owner/messages"
    below = repository(tmp_path / "below", OTHER, config=CONFIG.format(config), refs__remotes__origin__main=OWN)
    assert sign(tmp_path, GITHUB_WORKSPACE=str(tmp_path)) is None
    assert sign(below, GITHUB_WORKSPACE=str(tmp_path)) is not None
    for address in ("https://github.com/Owner/Robot.git", "git@github.com:owner/robot", "/srv/robot", ""):
        (below / ".git/config").write_text(CONFIG.format(address))
        assert "may be of a pull request" in (sign(tmp_path, GITHUB_WORKSPACE=str(tmp_path)) or ""), address


def git(*words: str, folder: Path) -> str:
    done = subprocess.run(["git", *words], cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout.strip()
