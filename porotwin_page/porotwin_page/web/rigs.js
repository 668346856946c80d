/* The choice of a rig: the pages of all rigs that the server knows. */

export const PERIOD_MS = 10000;

/* The options of the choice: none if there is only one rig. */
export function optionsOf(rigs) {
  return rigs.length < 2 ? [] : rigs.map(({ name, address, own }) => ({ name, address, own }));
}

export async function offerRigs(choice) {
  let rigs = [];
  try {
    const response = await fetch('/rigs');
    rigs = response.ok ? optionsOf(await response.json()) : [];
  } catch { /* the connection is lost; the header says so */ }
  const shown = JSON.stringify(rigs);
  choice.hidden = rigs.length === 0;
  if (choice.dataset.shown === shown) return;
  choice.dataset.shown = shown;
  choice.replaceChildren(...rigs.map(({ name, address, own }) => new Option(name, address, own, own)));
  choice.onchange = () => { location.href = choice.value; };
}
