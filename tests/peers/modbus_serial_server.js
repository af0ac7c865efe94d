// A server of npm modbus-serial. Arguments: tcp PORT, or rtu SERIAL_PORT.
// Holding register n holds n + 1000, input register n holds n + 2000. 150 to 159 refuse with exception 2,
// 160 is busy (exception 6), 170 answers after 0.4 s. Written registers and coils are remembered.
const ModbusRTU = require("modbus-serial");

const written = {};
const coils = {};

function refuse(address) {
    if (address >= 150 && address < 160) throw { modbusErrorCode: 2, msg: "no such register" };
    if (address === 160) throw { modbusErrorCode: 6, msg: "busy" };
}

const vector = {
    getHoldingRegister: (address) => {
        refuse(address);
        const value = address in written ? written[address] : address + 1000;
        if (address !== 170) return value;
        return new Promise((resolve) => setTimeout(() => resolve(value), 400));
    },
    getInputRegister: (address) => {
        refuse(address);
        return address + 2000;
    },
    getCoil: (address) => Boolean(coils[address]),
    getDiscreteInput: (address) => address % 3 === 0,
    setRegister: (address, value) => { refuse(address); written[address] = value; },
    setCoil: (address, value) => { coils[address] = value; },
};

const [kind, place] = process.argv.slice(2);
if (kind === "tcp") {
    const server = new ModbusRTU.ServerTCP(vector, { host: "127.0.0.1", port: Number(place), unitID: 1 });
    server.on("initialized", () => console.log("ready"));
    server.on("socketError", (error) => console.error(error));
} else {
    const server = new ModbusRTU.ServerSerial(vector, {
        port: place, baudRate: 19200, parity: "none", dataBits: 8, stopBits: 1, unitID: 1,
        openCallback: () => console.log("ready"),
    });
    server.on("error", (error) => console.error(error));
}
