// Undo and redo wherever the focus is. The picture sends its own keys; where text is typed they are the field's own.
window.onkeydown = (event) => {
  const key = event.key.toLowerCase();
  const command = key === "y" || (key === "z" && event.shiftKey) ? "redo" : key === "z" ? "undo" : "";
  const typed = "input:not([type=range]), textarea, .picture";
  if (!command || !(event.ctrlKey || event.metaKey) || event.altKey || event.target.closest?.(typed)) return;
  event.preventDefault();
  window.trame.trigger("run", [command]);
};
