// What scrolls sideways can be reached by keyboard.
for (const box of document.querySelectorAll("div.highlight pre, .table-wrapper")) box.tabIndex = 0;
