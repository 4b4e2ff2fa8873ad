/** Functions that create and find elements; strings become text nodes. */

/**
 * Creates an element with attributes and children; strings become text.
 * @template {keyof HTMLElementTagNameMap} Name
 * @param {Name} name
 * @param {Record<string, string | number | boolean>} [attributes] true: no value; false: omitted
 * @param {(Node | string)[]} children
 * @returns {HTMLElementTagNameMap[Name]}
 */
function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== false) element.setAttribute(key, value === true ? "" : String(value));
  }
  element.append(...children);
  return element;
}

/**
 * Has an element contain a text alone. While it moves, to change a text costs the page less than to replace it.
 * @param {Element} element
 * @param {string} text
 */
function write(element, text) {
  const { firstChild } = element;
  if (!(firstChild instanceof Text) || text === "") element.textContent = text;
  else if (firstChild.data !== text) firstChild.data = text;
}

/**
 * Returns the first match, which must exist.
 * @param {ParentNode} parent
 * @param {string} selector
 * @returns {HTMLElement}
 */
function find(parent, selector) {
  const found = parent.querySelector(selector);
  if (!(found instanceof HTMLElement)) throw new Error(`${selector} not found in the page`);
  return found;
}
