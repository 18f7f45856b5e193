// Ask a bridge by roslib what there is, and print the answers as JSON.
// Arguments: the folder with node_modules, and the port of rosbridge.
import { pathToFileURL } from "node:url";

const [folder, port] = process.argv.slice(2);
const entry = `${folder}/node_modules/roslib/dist/RosLib.js`;
const { Ros, Service, Topic } = await import(pathToFileURL(entry));

const ros = new Ros();
await new Promise((resolve, reject) => {
  ros.on("connection", resolve);
  ros.on("error", reject);
  ros.connect(`ws://127.0.0.1:${port}`);
});
const ask = (name, ...words) =>
  new Promise((resolve, reject) => ros[name](...words, resolve, reject));
const time = new Service({ ros, name: "rosapi/get_time", serviceType: "rosapi/GetTime" });
const definitions = await ask("getMessageDetails", "nav_msgs/msg/Odometry");
const scan = await new Promise((resolve) =>
  new Topic({
    ros,
    name: "/R1/lms200/scan",
    messageType: "sensor_msgs/msg/LaserScan",
  }).subscribe(resolve),
);
const answers = {
  topics: await ask("getTopics"),
  nodes: await ask("getNodes"),
  params: await ask("getParams"),
  scanners: await ask("getTopicsForType", "sensor_msgs/msg/LaserScan"),
  raw: await ask("getTopicsAndRawTypes"),
  odometry: ros.decodeTypeDefs(definitions),
  unknown: await ask("getMessageDetails", "no_msgs/msg/Such"),
  time: await new Promise((resolve, reject) => time.callService({}, resolve, reject)),
  beams: scan.ranges.length,
};
process.stdout.write(JSON.stringify(answers), () => process.exit(0));
