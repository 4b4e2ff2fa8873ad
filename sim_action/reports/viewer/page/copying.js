/** Buttons that copy commands. */

/** @param {ParentNode} part of the page */
function offerCopies(part) {
  for (const command of part.querySelectorAll(".command")) {
    const button = make("button", { type: "button", class: "copy" }, "Copy");
    button.addEventListener("click", () => void copy(command, button));
    command.append(button);
  }
}

/**
 * @param {Element} command
 * @param {HTMLButtonElement} button
 */
async function copy(command, button) {
  const code = find(command, "code");
  try {
    await navigator.clipboard.writeText(code.textContent ?? "");
    button.textContent = "Copied";
  } catch {
    // A page from a disk may have no access to the clipboard: select the text, so that the keyboard can copy it.
    getSelection()?.selectAllChildren(code);
    button.textContent = "Selected";
  }
  setTimeout(() => {
    button.textContent = "Copy";
  }, 1500);
}
