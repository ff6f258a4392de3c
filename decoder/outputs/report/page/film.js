// The film beside the report: it shows the frame under the pointer, or else the chosen one; played, it chooses frames.
import { byId } from "./dom.js";
import { frameText, secondsText } from "./words.js";

const WITHIN_S = 0.001; // into a frame: at its very beginning a player may still show the one before

export function useFilm(state) {
  const film = byId("film");
  if (!film) return;
  const { flight } = state;
  let wanted = -1; // the row to go to, once the player can
  let isPlaying = false;

  function show(row) {
    if (row < 0 || !film.isConnected) return; // keep the message that the film cannot be played
    byId("film-says").textContent = `${frameText(flight, row)} · ${secondsText(flight, row)}`;
    film.dataset.row = String(row);
    wanted = row;
    seek();
  }

  function seek() {
    if (wanted < 0 || film.seeking || film.readyState < HTMLMediaElement.HAVE_METADATA) return;
    film.currentTime = flight.film_s[wanted] + WITHIN_S;
    wanted = -1;
  }

  function follow() {
    if (film.paused || film.seeking || wanted >= 0) return;
    isPlaying = true;
    state.choose(rowAt(flight.film_s, film.currentTime));
    isPlaying = false;
  }

  state.on("row", () => {
    if (!isPlaying) show(state.row);
    else byId("film-says").textContent = "";
  });
  state.on("hover", () => film.paused && show(state.hovered < 0 ? state.row : state.hovered));
  for (const event of ["loadedmetadata", "seeked"]) film.addEventListener(event, seek);
  film.addEventListener("timeupdate", follow);
  film.addEventListener("click", () => (film.paused ? film.play() : film.pause()));
  film.addEventListener("error", () => {
    byId("film-says").textContent = `The film is not in this page's folder, or cannot be played: ${decodeURIComponent(film.getAttribute("src"))}`;
    film.remove();
  });
  if (film.error) film.dispatchEvent(new Event("error"));
}

// The row that is shown at a time of the film; where a clock was set, rows are in another order than the film.
function rowAt(film_s, time) {
  let best = 0;
  for (let row = 1; row < film_s.length; row++) {
    if (film_s[row] <= time && (film_s[row] > film_s[best] || film_s[best] > time)) best = row;
  }
  return best;
}
