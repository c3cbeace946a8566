// SPDX-License-Identifier: Apache-2.0
// Shows what the address asks for: ?src=..., or what is typed.
const player = document.querySelector('relievo-player');
const form = document.querySelector('form');
const output = document.querySelector('output');

form.addEventListener('submit', (event) => {
  event.preventDefault();
  player.src = form.elements.src.value;
});
player.addEventListener('statechange', ({ detail }) => {
  output.value = detail.message || detail.state;
});
player.addEventListener('frame', ({ detail }) => {
  output.value = `${player.state}: frame ${detail.number}, ${detail.vertices} vertices`;
});

const asked = new URLSearchParams(location.search).get('src');
if (asked !== null) {
  form.elements.src.value = asked;
  player.src = asked;
}
