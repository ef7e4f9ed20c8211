document.addEventListener("DOMContentLoaded", function () {
  var place = document.getElementById("plots");
  fetch(place.dataset.from).then(function (answer) {
    if (!answer.ok) throw new Error(answer.status);
    return answer.json();
  }).then(function (item) {
    place.textContent = "";
    return Bokeh.embed.embed_item(item);
  }).catch(function (error) {
    place.textContent = "The plots cannot be shown: " + error.message;
  });
});
