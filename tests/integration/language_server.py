"""A client of yaml-language-server, which VS Code and other editors use; it talks over standard input and output."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Self

from tests.integration.node import ENVIRONMENT, MODULES

_SERVER: Final = MODULES / "yaml-language-server/bin/yaml-language-server"


class LanguageServer:
    """A running server. It knows the schemas by patterns of file names, and fetches none from the network."""

    def __init__(self, schemas: Mapping[Path, str]) -> None:
        """Start the server; `schemas`: file of the schema -> pattern of the files that it is for."""
        self._settings: dict[str, Any] = {
            "yaml": {
                "schemas": {path.as_uri(): [pattern] for path, pattern in schemas.items()},
                "schemaStore": {"enable": False},
            }
        }
        self._process = subprocess.Popen(
            ["node", _SERVER, "--stdio"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=ENVIRONMENT
        )
        self._requests = 0
        self._asked_for_settings = False
        self._problems: dict[str, list[dict[str, Any]]] = {}
        document = {"hover": {"contentFormat": ["markdown"]}, "completion": {}, "publishDiagnostics": {}}
        capabilities = {"textDocument": document, "workspace": {"configuration": True}}
        self._ask("initialize", {"processId": None, "rootUri": None, "capabilities": capabilities})
        self._tell("initialized", {})
        self._tell("workspace/didChangeConfiguration", {"settings": self._settings})
        # Before the server has asked for its settings, it knows no schema.
        while not self._asked_for_settings:
            self._answer(self._read())

    def __enter__(self) -> Self:
        """Return the server."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the server."""
        self._process.kill()
        self._process.communicate()

    def open(self, address: str, text: str) -> None:
        """Open a document, or give an open one another text."""
        document = {"uri": address, "languageId": "yaml", "version": 1, "text": text}
        self._tell("textDocument/didOpen", {"textDocument": document})

    def problems(self, texts: Mapping[str, str]) -> dict[str, list[tuple[int, str]]]:
        """Return the problems of documents: address -> line, from 1, and message of each."""
        for address, text in texts.items():
            self.open(address, text)
        while not texts.keys() <= self._problems.keys():
            self._answer(self._read())
        return {
            address: [
                (problem["range"]["start"]["line"] + 1, problem["message"]) for problem in self._problems[address]
            ]
            for address in texts
        }

    def hover(self, address: str, line: int, column: int) -> str:
        """Return the text that an open document shows at a place; both numbers count from 0."""
        shown = self._ask("textDocument/hover", _place(address, line, column))
        return str(shown["contents"]["value"]) if shown else ""

    def completions(self, address: str, line: int, column: int) -> set[str]:
        """Return the labels that are offered at a place of an open document."""
        items = self._ask("textDocument/completion", _place(address, line, column))["items"]
        return {item["label"] for item in items}

    def _ask(self, method: str, parameters: object) -> Any:
        self._requests += 1
        self._send({"id": self._requests, "method": method, "params": parameters})
        while True:
            message = self._read()
            if message.get("id") == self._requests and "method" not in message:
                return message.get("result")
            self._answer(message)

    def _answer(self, message: dict[str, Any]) -> None:
        """Handle what the server says by itself."""
        method, parameters = message.get("method"), message.get("params", {})
        if method == "textDocument/publishDiagnostics":
            self._problems[parameters["uri"]] = parameters["diagnostics"]
        elif method == "workspace/configuration":
            sections = [self._settings.get(item["section"], {}) for item in parameters["items"]]
            self._send({"id": message["id"], "result": sections})
            self._asked_for_settings = True
        elif method and "id" in message:
            self._send({"id": message["id"], "result": None})

    def _tell(self, method: str, parameters: object) -> None:
        self._send({"method": method, "params": parameters})

    def _send(self, message: dict[str, Any]) -> None:
        assert self._process.stdin is not None
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._process.stdin.flush()

    def _read(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        size = 0
        while line := self._process.stdout.readline().strip():
            name, _, value = line.partition(b":")
            if name.lower() == b"content-length":
                size = int(value)
        assert size, "the server has ended"
        message: dict[str, Any] = json.loads(self._process.stdout.read(size))
        return message


def _place(address: str, line: int, column: int) -> dict[str, Any]:
    return {"textDocument": {"uri": address}, "position": {"line": line, "character": column}}
