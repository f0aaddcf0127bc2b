// validate_gltf.js FOLDER: positions.glb by the Khronos validator: no errors, warnings or remarks. Exit 77: it is not installed.
const fs = require('fs');
let validator;
try {
    validator = require('gltf-validator');
} catch (missing) {
    process.exit(77);
}
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2] + '/positions.glb'))).then((report) => {
    const found = report.issues;
    const unused = (message) => message.code === 'UNUSED_OBJECT' && message.severity === 2;
    if (found.messages.some((message) => !unused(message)) || !report.info.hasMorphTargets) {
        console.log(JSON.stringify(report, null, 1));
        process.exit(1);
    }
}, (error) => {
    console.log(String(error));
    process.exit(1);
});
