(function () {
  var root = document.documentElement, due = Number(root.dataset.due) * 1000, loaded = Date.now();
  function look() {
    var now = Date.now();
    if (now > due) root.classList.add("is-stale");
    document.querySelectorAll("time[data-t]").forEach(function (one) {
      var minutes = Math.round((Number(one.dataset.t) * 1000 - now) / 60000), far = Math.abs(minutes);
      var words = far < 90 ? far + " min" : far < 2880 ? (far / 60).toFixed(1) + " h" : (far / 1440).toFixed(1) + " days";
      one.textContent = minutes < 0 ? words + " ago" : "in " + words;
    });
    if (!root.dataset.live && now - loaded > 300000) location.reload();
  }
  look();
  setInterval(look, 20000);
  if (root.dataset.live) {
    var source = new EventSource(root.dataset.live);
    source.addEventListener("news", function () {  // a moment apart: not all who look ask at once
      source.close();
      setTimeout(function () { location.reload(); }, 1000 * Math.random());
    });
  }
})();
