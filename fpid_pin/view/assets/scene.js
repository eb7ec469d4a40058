"use strict";
// What is seen, as data of the page: a report shows another group by writing its number there.
const SCENE = JSON.parse(document.getElementById("scene").textContent);
if (SCENE.groups) Object.assign(SCENE, SCENE.groups[SCENE.shown]);
