"use strict";
// Renews what the page shows. Nothing here is needed to use it: without scripts it is renewed by hand.
(() => {
  const EVERY = 15000;
  const PATIENCE = 10000;

  // Whoever types, or has unfolded a form, is not to lose it.
  const inUse = (part) => {
    const focused = document.activeElement;
    return (focused !== document.body && part.contains(focused)) || part.querySelector("details.change[open]");
  };

  const renewed = (part, fresh) => {
    // What is as it was is left alone, so that a screen reader says only what is new.
    if (part.innerHTML === fresh.innerHTML && part.className === fresh.className) return;
    for (const open of part.querySelectorAll("details[open]")) {
      const same = open.id && fresh.querySelector("#" + CSS.escape(open.id));
      if (same) same.open = true;
    }
    part.className = fresh.className;
    part.replaceChildren(...fresh.childNodes);
  };

  const renew = async () => {
    const stale = document.getElementById("stale");
    try {
      const answer = await fetch(location.pathname + location.search, { signal: AbortSignal.timeout(PATIENCE) });
      if (!answer.ok) throw new Error(String(answer.status));
      const page = new DOMParser().parseFromString(await answer.text(), "text/html");
      for (const part of document.querySelectorAll("[data-live]")) {
        const fresh = page.getElementById(part.id);
        if (fresh && !inUse(part)) renewed(part, fresh);
      }
      document.title = page.title;
      stale.hidden = true;
    } catch {
      stale.hidden = false;
    }
    setTimeout(renew, EVERY);
  };

  setTimeout(renew, EVERY);
})();
