// For browsers that do not know modules.
document.addEventListener("DOMContentLoaded", function () {
  document.body.textContent = "This browser is too old for this page. Please use a newer one.";
});
