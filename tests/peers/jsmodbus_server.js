// A server of npm jsmodbus. Argument: PORT. Holding register n holds n + 3000, for n below 100.
// Beyond that it answers with fewer data than were asked for, or none: a good hostile case.
const net = require("net");
const jsmodbus = require("jsmodbus");

const holding = Buffer.alloc(200);
for (let address = 0; address < 100; address++) holding.writeUInt16BE(address + 3000, 2 * address);
const sockets = new net.Server();
new jsmodbus.server.TCP(sockets, { holding, input: holding, coils: Buffer.alloc(10), discrete: Buffer.alloc(10) });
sockets.listen(Number(process.argv[2]), "127.0.0.1", () => console.log("ready"));
