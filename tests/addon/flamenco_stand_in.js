// SPDX-License-Identifier: GPL-3.0-or-later
// What Flamenco's Manager gives a job compiler script, for Node: compiles the job that standard input describes.
//
//     node flamenco_stand_in.js SCRIPT < job.json
//
// Prints the job type and the tasks that the script adds, or, with exit status 1, what it throws.

"use strict";
const fs = require("fs");
const vm = require("vm");

function frames(range) {
    const found = new Set();
    for (const part of range.replaceAll("..", "-").split(",")) {
        const ends = part.split("-").map((text) => text.trim());
        if (ends.length > 2 || ends.some((text) => !/^\d+$/.test(text))) {
            throw new Error(`invalid range "${range}": ${part}`);
        }
        for (let frame = Number(ends[0]); frame <= Number(ends.at(-1)); frame++) {
            found.add(frame);
        }
    }
    return [...found].sort((a, b) => a - b);
}

// As in "3-8,13,15-17"; two neighbors are written as 15,16.
function merged(list) {
    const runs = [];
    for (const frame of list) {
        if (runs.length && frame === runs.at(-1).at(-1) + 1) {
            runs.at(-1).push(frame);
        } else {
            runs.push([frame]);
        }
    }
    return runs.map((run) => (run.length > 2 ? `${run[0]}-${run.at(-1)}` : run.join(","))).join(",");
}

function frameChunker(range, size) {
    if (size < 1) {
        throw new Error(`invalid chunk size, must be positive number: ${size}`);
    }
    const list = frames(range);
    const chunks = [];
    for (let start = 0; start < list.length; start += size) {
        chunks.push(merged(list.slice(start, start + size)));
    }
    return chunks;
}

class Task {
    constructor(name, type) {
        if (!name.trim() || !type.trim()) {
            throw new Error("author.Task(name, type): both are required");
        }
        Object.assign(this, { name: name, type: type, commands: [], dependencies: [] });
    }
    addCommand(command) {
        this.commands.push(command);
    }
    addDependency(task) {
        this.dependencies.push(task.name);
    }
}

const tasks = [];
const job = { created: new Date(), ...JSON.parse(fs.readFileSync(0, "utf8")), addTask: (task) => tasks.push(task) };
const script = fs.readFileSync(process.argv[2], "utf8");
const globals = {
    author: {
        // called without `new`, as functions of Go are
        Task: (name, type) => new Task(name, type),
        Command: (name, parameters) => ({ name: name, parameters: parameters }),
    },
    frameChunker: frameChunker,
    formatTimestampLocal: () => "2026-11-22_120000",
    print: () => undefined,
};
try {
    const jobType = vm.runInNewContext(`"use strict";${script};compileJob(job);JOB_TYPE`, { ...globals, job: job });
    console.log(JSON.stringify({ jobType: jobType, tasks: tasks, settings: job.settings }));
} catch (error) {
    console.error(String(error.message || error));
    process.exitCode = 1;
}
