// SPDX-License-Identifier: GPL-3.0-or-later
// Umbra Black Hole as a job type of Flamenco 3: each chunk of frames is baked, then rendered.

const JOB_TYPE = {
    label: "Umbra Black Hole",
    description: "Bake the warp maps of a black hole, then render. Workers that only render need no add-on",
    settings: [
        // Chosen by the artist.
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            evalInfo: { showLinkButton: true, description: "Scene frame range" },
            description: "Frames to bake and render, such as 47, 1-30 or 3, 5-10, 47-327",
        },
        {
            key: "chunk_size", type: "int32", default: 10, propargs: { min: 1, max: 100000 }, visible: "submission",
            description: "Frames of one task",
        },
        {
            key: "bake", type: "bool", default: true, required: false, visible: "submission",
            description: "Bake what is missing or out of date before rendering; off where the maps are baked already",
        },
        {
            key: "bake_task_type", type: "string", default: "blender", required: false, visible: "hidden",
            description: "Task type of baking: only workers that list it take these tasks",
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path", required: true, visible: "submission",
            description: "Folder for the pictures; a folder for the job is made in it",
        },
        {
            key: "render_output_path", type: "string", subtype: "file_path", editable: false,
            eval: "str(Path(abspath(settings.render_output_root), jobname, '{timestamp}', '######'))",
            description: "Where the pictures go",
        },

        // Known from the file.
        { key: "blendfile", type: "string", required: true, visible: "web", description: "Blender file" },
        {
            key: "format", type: "string", required: true, visible: "web",
            eval: "C.scene.render.image_settings.file_format",
        },
    ],
};

// What writes one movie cannot be rendered in chunks.
const MOVIE_FORMATS = ["FFMPEG", "AVI_RAW", "AVI_JPEG"];

// Lets a worker without the add-on refuse to render without a map, which would be magenta.
const FARM_SCRIPT = @umbra_farm.py@;

function compileJob(job) {
    const settings = job.settings;
    if (MOVIE_FORMATS.includes(settings.format)) {
        throw `Frames are rendered in chunks, which the format ${settings.format} cannot be: choose an image format.`;
    }
    if (!settings.render_output_path) {
        throw "There is no folder for the pictures: choose one in the setting Render Output Root.";
    }
    settings.render_output_path = settings.render_output_path.replace("{timestamp}", formatTimestampLocal(job.created));

    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const render = renderTask(settings, chunk);
        if (settings.bake !== false) {
            const bake = bakeTask(settings, chunk);
            job.addTask(bake);
            render.addDependency(bake);
        }
        job.addTask(render);
    }
}

function bakeTask(settings, chunk) {
    const task = author.Task(`bake-${chunk}`, settings.bake_task_type || "blender");
    task.addCommand(blender(settings, ["--command", "umbra", "bake", `--frames=${chunk}`]));
    return task;
}

function renderTask(settings, chunk) {
    const task = author.Task(`render-${chunk}`, "blender");
    task.addCommand(blender(settings, [
        "--python-exit-code", "1",
        "--python-expr", FARM_SCRIPT,
        "--render-output", settings.render_output_path,
        "--render-format", settings.format,
        "--render-frame", chunk.replaceAll("-", ".."), // Blender's own notation
        "--",
        "check", `--frames=${chunk}`,
    ]));
    return task;
}

function blender(settings, args) {
    return author.Command("blender-render", {
        exe: "{blender}",
        exeArgs: "{blenderArgs}",
        argsBefore: ["--background"],
        blendfile: settings.blendfile,
        args: args,
    });
}
